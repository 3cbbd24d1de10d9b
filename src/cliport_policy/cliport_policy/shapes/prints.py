"""Prints: patches on what is flat that have the outline of what is picked, and how it must be turned to cover them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray
from torch import Tensor

from cliport_policy.observation import unscaled
from cliport_policy.shapes.silhouettes import standing
from panda_model import load_preset

_HAND = load_preset().hand  # whose jaws hold what is picked
_SQUARE = math.radians(18)  # up to which jaws are turned to be square with what they close on
_BESIDE_PICK = 0.01  # how far beside a thing it may be picked, at a ring's middle say [m]
_REACH, _STEP = 0.01, 0.005  # how far beside a place a print is looked for, and in which steps at first [m]
_GAP, _BAND = 0.0025, 0.01  # what lies around a print is looked at from here to there beyond its edge [m]
_FLAT = 0.006  # what stands out so far within the outline is no print [m]
_POINTS = 160  # at most, inside an outline and around it
_LEAST_POINTS = 12  # of an outline that says anything
_FEW = 48  # of them at the first look
_ROUGHLY = 18  # rotations at the first look
_WORTH = 2.0  # contrast then from which on a place is looked at again
_TRIED, _NOTHING = 2, 1.0  # places after which no more are looked at, if the contrast was less than this
_NOISE = 3 * 0.015**2  # variance of an even surface's colour, components in 0..1
_LEAST_KNOWN = 0.1  # share of the points of an outline, or around it, that must be seen
_SAME = 40.0  # contrast of a thing's cells to all others from which on it has an outline
_LEVEL = 0.003  # how much higher or lower than around a print it may be around what lies on another one [m]

Pixel = tuple[int, int]  # (row, col)


class Outline(NamedTuple):
    """Points of what is picked, and points around it, as (row, col) pixels from the pick: (N, 2) and (M, 2).

    held: (2,), the point that jaws have between them; centre: (2,), of the smallest rectangle around it, likewise.
    yaw: of jaws that are square with that rectangle [rad]. hides: (rows, cols), where what lies beneath is not seen.
    """

    inside: NDArray[np.float32]
    around: NDArray[np.float32]
    held: NDArray[np.float32]
    centre: NDArray[np.float32]
    yaw: float
    hides: NDArray[np.bool_]


class Print(NamedTuple):
    """Patch on something flat that looks like an outline.

    pixel: (row, col), where the point between the jaws comes to lie.
    turn: angle by which it must be turned [rad].
    contrast: squared distance of the mean colours inside the outline and around it, over their variances.
    centre: (row, col), where the outline's centre comes to lie.
    """

    pixel: Pixel
    turn: float
    contrast: float
    centre: Pixel


def outline_at(image: Tensor, pixel: Pixel, yaw: float, pixel_size: float) -> Outline | None:
    """Return the outline of the thing at a pick, None where none stands there that is as large as one to hold.

    image: (1, 5, rows, cols), an observation. yaw: of the jaws [rad], which is made square with the thing where it is
    nearly so: a thing between slanted jaws slips.
    """
    height, valid = unscaled(image)[0, 3].numpy(), image[0, 4].numpy() > 0
    things = [(thing, np.argwhere(thing)) for thing in standing(height, valid, pixel_size)]
    beside = [np.hypot(*(points - np.array(pixel)).T).min() for _, points in things]
    if not things or min(beside) > _BESIDE_PICK / pixel_size:
        return None
    thing, points = things[int(np.argmin(beside))]
    gap, band = (_disc(reach / pixel_size) for reach in (_GAP, _BAND))
    cells = np.pad(thing.astype(np.uint8), len(band))
    parts = cv2.erode(cells, gap), cv2.dilate(cells, band) - cv2.dilate(cells, gap)
    inside, around = (_thinned(np.argwhere(part) - np.array(pixel) - len(band), _POINTS) for part in parts)
    if min(len(inside), len(around)) < _LEAST_POINTS:
        return None
    (row, col), _, slant = cv2.minAreaRect(points.astype(np.float32))  # its slant is seen from the rows
    off = math.remainder(math.pi / 2 - math.radians(slant) - yaw, math.pi / 2)
    yaw += off if abs(off) <= _SQUARE else 0.0
    held = _held(points, pixel, yaw, pixel_size)
    centre = np.array((row - pixel[0], col - pixel[1]), np.float32)
    return Outline(inside, around, held, centre, yaw, cv2.dilate(thing.astype(np.uint8), gap) > 0)


def covered_at(image: Tensor, outline: Outline, pick: Pixel, found: Print, pixel_size: float) -> list[Pixel]:
    """Return the places of other things that have an outline and lie as high as a print: they hide one like it.

    image: (1, 5, rows, cols), an observation. pick: the outline's.
    """
    height, valid = unscaled(image)[0, 3].numpy(), image[0, 4].numpy() > 0
    level = _height_around(height, outline, found)
    middle = outline.inside.mean(0)
    inside, around, held, centre = (points - middle for points in outline[:4])
    about = outline._replace(inside=inside, around=around, held=held, centre=centre)
    angles = np.arange(2 * _ROUGHLY, dtype=np.float32) * (math.pi / _ROUGHLY)
    covered = []
    for thing in standing(height, valid, pixel_size):
        row, col = np.rint(np.argwhere(thing).mean(0)).astype(int).tolist()
        if math.dist((row, col), middle + pick) * pixel_size > _BESIDE_PICK:
            alone = np.dstack([thing] * 3 + [np.zeros_like(thing), np.ones_like(thing)]).astype(np.float32)
            best = _best_print(alone, about, (row, col), angles, pixel_size)
            if best.contrast > _SAME and abs(_height_around(height, about, best) - level) < _LEVEL:
                covered.append(best.centre)
    return covered


def _height_around(height: NDArray[np.float32], outline: Outline, found: Print) -> float:
    """Return the mean height [m] around what lies at a print."""
    turned = (outline.around - outline.held) @ _turns(np.array(found.turn, np.float32)) + np.array(found.pixel)
    return float(_seen_at(height[..., None], turned[None].astype(np.float32)).mean())


def _held(points: NDArray[np.int64], pick: Pixel, yaw: float, pixel_size: float) -> NDArray[np.float32]:
    """Return the point that jaws have between them, (2,) pixels from the pick.

    They close on a thing's points (N, 2) at its centroid: midway between what they touch, which may be beside it, as
    in the corner of an L. A thing too wide for them there is held where it is picked.
    """
    along, across = np.array((math.sin(yaw), math.cos(yaw))), np.array((math.cos(yaw), -math.sin(yaw)))
    beside = points @ across - points.mean(0) @ across
    met = points[np.abs(beside) * pixel_size <= _HAND.finger_half_width] @ along
    if not len(met) or np.ptp(met) * pixel_size > _HAND.widest:
        return np.zeros(2, np.float32)
    middle = along * (met.min() + met.max()) / 2 + across * (points.mean(0) @ across)
    return np.asarray(middle - pick, np.float32)


def prints_at(
    image: Tensor, outline: Outline, places: Sequence[Pixel], angles: Tensor, pixel_size: float
) -> list[Print]:
    """Return what looks most like a print of an outline beside each place; none if there is none at the first places.

    image: (1, 5, rows, cols), an observation. angles: (k,) rad about +z, relative to the thing as it lies.
    """
    seen = np.ascontiguousarray(unscaled(image)[0].permute(1, 2, 0).numpy())
    seen = np.dstack([seen[..., :4], (image[0, 4].numpy() > 0) & ~outline.hides])
    found = []
    for place in places:
        found.append(_best_print(seen, outline, place, angles.numpy(), pixel_size))
        if len(found) == _TRIED and max(one.contrast for one in found) < _NOTHING:
            return []  # where one hole is, others are near, and show some contrast, too
    return found


def _best_print(
    seen: NDArray[np.float32], outline: Outline, place: Pixel, angles: NDArray[np.float32], pixel_size: float
) -> Print:
    """Return what looks most like a print of an outline, up to _REACH from a place: roughly, then closer twice."""
    reach, step = round(_REACH / pixel_size), max(round(_STEP / pixel_size), 1)
    few = outline._replace(inside=_thinned(outline.inside, _FEW), around=_thinned(outline.around, _FEW))
    at, turn = _pairs(_around(place, reach, step), angles[:: max(1, len(angles) // _ROUGHLY)])
    contrast = _contrast(seen, few, at, turn)
    if contrast.max() < _WORTH:
        return Print(place, 0.0, float(contrast.max()), place)
    for points, count, shift, slant in ((few, 12, step - 1, 0.17), (outline, 6, 1, 0.06)):
        best = np.argsort(contrast)[-count:]
        shifts, slants = _pairs(_around((0, 0), shift, 1), np.array((-slant, 0.0, slant), np.float32))
        at, turn = (at[best, None] + shifts).reshape(-1, 2), (turn[best, None] + slants).ravel()
        contrast = _contrast(seen, points, at, turn)
    found = int(contrast.argmax())
    held, centre = (
        np.rint(at[found] + point @ _turns(turn[found])).astype(int).tolist()
        for point in (outline.held, outline.centre)
    )
    return Print(tuple(held), float(turn[found]), float(contrast[found]), tuple(centre))


def _contrast(
    seen: NDArray[np.float32], outline: Outline, at: NDArray[np.int64], angles: NDArray[np.float32]
) -> NDArray[np.float32]:
    """Return the contrast of a print at each of places (n, 2) under its rotation (n,).

    It is 0 where something stands, and where too little is seen. seen: (rows, cols, 5), colours in 0..1, heights [m]
    and what is known.
    """
    corners = at[:, None].astype(np.float32)
    inside, around = (_seen_at(seen, points @ _turns(angles) + corners) for points in outline[:2])
    (within, spread, shown), (beyond, noise, known) = (_mean_and_spread(part) for part in (inside, around))
    between = np.square(within[:, :3] - beyond[:, :3]).sum(1)
    is_flat = (within[:, 3] - beyond[:, 3] < _FLAT) & (np.minimum(shown, known) >= _LEAST_KNOWN)
    return np.where(is_flat, between / (spread + noise + _NOISE), 0.0)


def _mean_and_spread(part: NDArray[np.float32]) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.float32]]:
    """Return the mean (n, 4) of points (n, m, 5), the variance (n,) of their colours, and the share that is known."""
    values, known = part[..., :4], part[..., 4]
    count = known.sum(1)
    mean = np.einsum("nmc,nm->nc", values, known) / np.maximum(count, 1)[:, None]
    colors = values[..., :3]
    square = np.einsum("nmc,nmc,nm->n", colors, colors, known) / np.maximum(count, 1)
    return mean, np.maximum(square - np.square(mean[:, :3]).sum(1), 0), count / part.shape[1]


def _turns(angles: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return what turns (row, col), of y and x, by angles about +z if multiplied from the right: (..., 2, 2)."""
    cos, sin = np.cos(angles), np.sin(angles)
    return np.stack([np.stack([cos, -sin], -1), np.stack([sin, cos], -1)], -2)


def _seen_at(seen: NDArray[np.float32], points: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return what is seen at the cells nearest to points (n, m, 2), those beyond the border at it: (n, m, 4)."""
    rows, cols = seen.shape[:2]
    row, col = (np.rint(points[..., axis]).astype(np.int32) for axis in (0, 1))
    cells = row.clip(0, rows - 1) * cols + col.clip(0, cols - 1)
    return seen.reshape(-1, seen.shape[-1]).take(cells, axis=0)


def _pairs(places: NDArray[np.int64], turns: NDArray[np.float32]) -> tuple[NDArray[np.int64], NDArray[np.float32]]:
    """Return each place (n, 2) with each turn (m,): (n m, 2) and (n m,)."""
    return places.repeat(len(turns), 0), np.tile(turns, len(places))


def _around(place: Pixel, reach: int, step: int) -> NDArray[np.int64]:
    """Return the pixels (m, 2) of a square around a place."""
    steps = np.arange(-(reach // step), reach // step + 1) * step
    return np.stack(np.meshgrid(steps, steps, indexing="ij"), -1).reshape(-1, 2) + np.array(place)


def _disc(reach: float) -> NDArray[np.uint8]:
    side = 2 * max(round(reach), 1) + 1
    return np.asarray(cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (side, side)), np.uint8)


def _thinned(points: NDArray[Any], most: int) -> NDArray[np.float32]:
    return points[:: max(1, -(-len(points) // most))].astype(np.float32)
