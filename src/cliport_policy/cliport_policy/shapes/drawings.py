"""Outlines to learn from: letters and digits of Matplotlib's fonts, figures by their geometry, and other blobs."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import cv2
import numpy as np
from matplotlib.font_manager import FontProperties
from matplotlib.textpath import TextPath
from numpy.typing import NDArray

from cliport_policy.shapes.names import SHAPES
from cliport_policy.shapes.silhouettes import picture_of

_FONTS = (
    FontProperties(family="DejaVu Sans", weight="bold"),
    FontProperties(family="DejaVu Sans"),
    FontProperties(family="DejaVu Sans Mono", weight="bold"),
    FontProperties(family="DejaVu Serif", weight="bold"),
    FontProperties(family="STIXGeneral", weight="bold"),
    FontProperties(family="cmss10"),
    FontProperties(family="cmtt10"),
)
_SYMBOLS = {"heart": "\u2665", "star": "\u2605", "crescent": "\u263e"}  # figures that the first two fonts hold, too
_CANVAS = 192  # side on which an outline is drawn [fine pixels]
_FINE = 6.0  # fine pixels of a heightmap's
_ACROSS = (10.0, 26.0)  # of a shape, in a heightmap's pixels: 2.5 to 6.5 cm
_STROKE = (0.0, 0.12)  # by which letters are made bolder, as a share of their height
Polygon = NDArray[np.float64]  # (N, 2)


def draw(number: int, rng: np.random.Generator) -> NDArray[np.float32]:
    """Return the picture (SIDE, SIDE) of one of SHAPES as a camera may see it; behind the last is any other thing."""
    while True:
        cells = _seen(_drawn(number, rng), rng)
        if cells.sum() >= 12:
            return picture_of(cells)


def _drawn(number: int, rng: np.random.Generator) -> NDArray[np.uint8]:
    """Return a mask (_CANVAS, _CANVAS) in 0..255, in the middle, as large as the canvas allows."""
    if number == len(SHAPES):
        return _filled(_other(rng))
    name = SHAPES[number]
    if name in _SYMBOLS and rng.random() < 0.4:
        return _filled(_glyph(_SYMBOLS[name], _FONTS[int(rng.integers(2))]))
    if name in _FIGURES:
        return _filled(_FIGURES[name](rng))
    mask = _filled(_glyph(name[-1], _FONTS[int(rng.integers(len(_FONTS)))]))
    width = int(rng.uniform(*_STROKE) * 0.6 * _CANVAS)
    return np.asarray(cv2.dilate(mask, np.ones((3, 3), np.uint8), iterations=width // 2), np.uint8)


def _glyph(character: str, font: FontProperties) -> list[Polygon]:
    path = TextPath((0, 0), character, size=100, prop=font)
    return [np.asarray(polygon, np.float64) * (1, -1) for polygon in path.to_polygons()]


def _filled(polygons: Sequence[Polygon]) -> NDArray[np.uint8]:
    """Return the even-odd inside of polygons, scaled to three fifths of the canvas."""
    every = np.concatenate(polygons)
    low, high = every.min(0), every.max(0)
    scale = 0.6 * _CANVAS / max(high - low)
    moved = [np.round(16 * ((each - (low + high) / 2) * scale + _CANVAS / 2)).astype(np.int32) for each in polygons]
    mask = np.zeros((_CANVAS, _CANVAS), np.uint8)
    cv2.fillPoly(mask, moved, 255, shift=4)
    return mask


def _seen(mask: NDArray[np.uint8], rng: np.random.Generator) -> NDArray[np.bool_]:
    """Return the cells of a heightmap where a turned, stretched and bent outline is seen, with errors at its edge."""
    across = rng.uniform(*_ACROSS) / (0.6 * _CANVAS)
    angle, stretch, shear = rng.uniform(0, 2 * np.pi), np.exp(rng.normal(0, 0.06)), rng.normal(0, 0.05)
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    matrix = across * turn @ np.array([[stretch, shear], [0, 1 / stretch]])
    side = 44
    shift = side / 2 + rng.uniform(-0.5, 0.5, 2) - matrix @ np.array([_CANVAS / 2, _CANVAS / 2])
    blurred = cv2.GaussianBlur(mask, (0, 0), 0.35 / across)
    small = cv2.warpAffine(blurred, np.column_stack([matrix, shift]), (side, side), flags=cv2.INTER_LINEAR) / 255.0
    noise = cv2.GaussianBlur(rng.normal(0, 1, (side, side)), (0, 0), 0.8)
    cells = small + rng.uniform(0, 0.25) * noise > rng.uniform(0.3, 0.65)
    count, labels, stats, _ = cv2.connectedComponentsWithStats(cells.astype(np.uint8), connectivity=4)
    largest = 1 + int(stats[1:, cv2.CC_STAT_AREA].argmax()) if count > 1 else 0
    return np.asarray(cells if largest == 0 else labels == largest)


def _ring_of(radii: Sequence[float], first: float = 0.0) -> Polygon:
    angles = first + 2 * np.pi * np.arange(len(radii)) / len(radii)
    return np.asarray(radii)[:, None] * np.column_stack([np.cos(angles), np.sin(angles)])


def _regular(corners: int) -> Callable[[np.random.Generator], list[Polygon]]:
    return lambda _: [_ring_of([1.0] * corners)]


def _rectangle(width: float, height: float) -> list[Polygon]:
    return [np.array([(-width, -height), (width, -height), (width, height), (-width, height)]) / 2]


def _star(rng: np.random.Generator) -> list[Polygon]:
    points = int(rng.choice([5, 5, 5, 6]))
    return [_ring_of([1.0, rng.uniform(0.36, 0.6)] * points)]


def _plus(rng: np.random.Generator) -> list[Polygon]:
    w = rng.uniform(0.2, 0.55)
    corner = np.array([(1, -w), (1, w), (w, w)])
    quarter = np.array([(0, 1), (-1, 0)])
    return [np.concatenate([corner @ np.linalg.matrix_power(quarter, k) for k in range(4)])]


def _ring(rng: np.random.Generator) -> list[Polygon]:
    return [_ring_of([1.0] * 48), _ring_of([rng.uniform(0.3, 0.7)] * 48)]


def _flower(rng: np.random.Generator) -> list[Polygon]:
    petals, depth = int(rng.integers(4, 9)), rng.uniform(0.1, 0.3)
    angles = np.linspace(0, 2 * np.pi, 96, endpoint=False)
    return [_ring_of(list(1 - depth + depth * np.cos(petals * angles)))]


def _heart(rng: np.random.Generator) -> list[Polygon]:
    """Return two round lobes over a tip, with a deep or a shallow notch between them."""
    t = np.linspace(0, 2 * np.pi, 64, endpoint=False)
    if rng.random() < 0.5:
        notch, width = rng.uniform(3, 6), rng.uniform(14, 18)
        y = 13 * np.cos(t) - notch * np.cos(2 * t) - 2 * np.cos(3 * t) - rng.uniform(0, 1) * np.cos(4 * t)
        return [np.column_stack([width * np.sin(t) ** 3, -y])]
    lobe = np.linspace(np.pi, 2 * np.pi, 24)  # a half circle each, down straight or bent sides
    bend, long = rng.uniform(0, 0.35), rng.uniform(1.5, 2.2)
    down = np.linspace(0, 1, 16)[1:, None]
    side = (1 - down) * (2, 0) + down * (0, long) + bend * (np.sin(np.pi * down) * (1, 0.6))
    right = np.concatenate([np.column_stack([1 + np.cos(lobe), np.sin(lobe)]), side])
    return [np.concatenate([right, (right * (-1, 1))[::-1]])]


def _crescent(rng: np.random.Generator) -> list[Polygon]:
    bite = rng.uniform(0.2, 0.6)
    t = np.linspace(-np.pi / 2, np.pi / 2, 32)
    outer = np.column_stack([np.cos(t), np.sin(t)])
    inner = np.column_stack([(1 - 2 * bite) * np.cos(t[::-1]), np.sin(t[::-1])])
    return [np.concatenate([outer, inner])] if rng.random() < 0.5 else [_moon(rng.uniform(0.3, 0.7))]


def _moon(shift: float) -> Polygon:
    """Return a circle that another, `shift` aside and nearly as large, has bitten."""
    r, end = 0.85, np.arccos((1 + shift**2 - 0.85**2) / (2 * shift)) if shift > 0.16 else 0.1
    outer = np.linspace(end, 2 * np.pi - end, 40)
    tip = np.array([np.cos(end) - shift, np.sin(end)])
    begin = np.arctan2(tip[1], tip[0])
    inner = np.linspace(2 * np.pi - begin, begin, 40)
    return np.concatenate(
        [
            np.column_stack([np.cos(outer), np.sin(outer)]),
            np.column_stack([shift + r * np.cos(inner), r * np.sin(inner)]),
        ]
    )


def _semicircle(_: np.random.Generator) -> list[Polygon]:
    t = np.linspace(0, np.pi, 32)
    return [np.column_stack([np.cos(t), np.sin(t)])]


def _arrow(rng: np.random.Generator) -> list[Polygon]:
    head, shaft = rng.uniform(0.6, 1.1), rng.uniform(0.15, 0.4)
    upper = [(-1, shaft / 2), (1 - head, shaft / 2), (1 - head, rng.uniform(0.5, 0.8)), (1, 0)]
    return [np.array([*upper, *((x, -y) for x, y in upper[-2::-1])])]


def _trapezoid(rng: np.random.Generator) -> list[Polygon]:
    top, high = rng.uniform(0.3, 0.7), rng.uniform(0.5, 1.1)
    return [np.array([(-1, -high / 2), (1, -high / 2), (top, high / 2), (-top, high / 2)])]


def _parallelogram(rng: np.random.Generator) -> list[Polygon]:
    lean, high = rng.uniform(0.3, 0.7), rng.uniform(0.5, 1.0)
    return [np.array([(-1 - lean, -high), (1 - lean, -high), (1 + lean, high), (lean - 1, high)]) / 2]


def _diamond(rng: np.random.Generator) -> list[Polygon]:
    return [_ring_of([1.0, 1.0, 1.0, 1.0]) * (1, rng.uniform(0.5, 0.9))]


def _triangle(rng: np.random.Generator) -> list[Polygon]:
    return [np.array([(-1, 0), (1, 0), (rng.normal(0, 0.15), rng.uniform(1.3, 2.1))])]


def _other(rng: np.random.Generator) -> list[Polygon]:
    """Return what is no named shape: a blob, a handful of corners, a thin bar, or two things that touch."""
    kind = rng.random()
    if kind < 0.35:
        angles = np.linspace(0, 2 * np.pi, 64, endpoint=False)
        waves = sum(rng.normal(0, 0.25 / k) * np.cos(k * angles + rng.uniform(0, 6.28)) for k in range(1, 6))
        return [_ring_of(list(np.clip(1 + waves, 0.15, None))) * (1, rng.uniform(0.3, 1))]
    if kind < 0.6:
        return [_ring_of(list(rng.uniform(0.2, 1, int(rng.integers(5, 12))))) * (1, rng.uniform(0.4, 1))]
    if kind < 0.75:
        return _rectangle(2.0, rng.uniform(0.1, 0.35))
    first, second = (SHAPES[int(i)] for i in rng.integers(len(SHAPES) - len(_FIGURES), len(SHAPES), 2))
    a, b = _FIGURES[first](rng), _FIGURES[second](rng)
    return [a[0], b[0] * rng.uniform(0.6, 1.2) + rng.uniform(0.8, 1.6, 2) * rng.choice([-1, 1], 2)]


_FIGURES: dict[str, Callable[[np.random.Generator], list[Polygon]]] = {
    "arrow": _arrow,
    "circle": _regular(48),
    "crescent": _crescent,
    "diamond": _diamond,
    "flower": _flower,
    "heart": _heart,
    "hexagon": _regular(6),
    "octagon": _regular(8),
    "oval": lambda rng: [_ring_of([1.0] * 48) * (1, rng.uniform(0.5, 0.8))],
    "parallelogram": _parallelogram,
    "pentagon": _regular(5),
    "plus": _plus,
    "rectangle": lambda rng: _rectangle(2.0, rng.uniform(0.8, 1.5)),
    "ring": _ring,
    "semicircle": _semicircle,
    "square": lambda _: _rectangle(2.0, 2.0),
    "star": _star,
    "trapezoid": _trapezoid,
    "triangle": _triangle,
}
