"""Small scenes painted, cut out and moved with loaded dice: what comes out is known beforehand."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from cliport_core.heightmap import Heightmap
from cliport_core.workspace import WorkspaceSpec
from cliport_policy.data.augmentation import PlanarTransform, draw_transform, jitter_color, jitter_height
from cliport_policy.data.color_names import distance, lab
from cliport_policy.data.demonstrations import Demonstration
from cliport_policy.data.rearrange import Cutout, _bounds, _cut_out_turned, _find_free_place, rearranged
from cliport_policy.data.recolor import Paint, Repainting, _color_at, _repaint, _spread, named_colors
from cliport_policy.data.things import Thing, find_things, raised

SPEC = WorkspaceSpec()  # 320 x 160 pixels
RED, BLUE, TABLE = (255, 87, 89), (78, 121, 167), (90, 90, 90)


class Means:
    """A generator that draws each mean plus a number of spreads, and notes how often it was asked."""

    def __init__(self, spreads: float) -> None:
        self.spreads, self.asked = spreads, 0

    def normal(self, mean: float, spread: float, size: int | None = None) -> Any:
        self.asked += 1
        value = mean + self.spreads * spread
        return value if size is None else np.full(size, value)

    def uniform(self, low: float, high: float) -> float:
        assert (low, high) == (-math.pi, math.pi)
        return self.spreads


def scene(*things: tuple[slice, slice, tuple[int, int, int]]) -> Heightmap:
    color, height = np.full((*SPEC.shape, 3), TABLE, np.uint8), np.zeros(SPEC.shape, np.float32)
    for rows, cols, shade in things:
        color[rows, cols], height[rows, cols] = shade, 0.03
    return Heightmap(color, height, np.ones(SPEC.shape, bool), SPEC)


def test_a_jitter_of_one_spread() -> None:
    """4 % of all channels, 2 % of each, 5 of 255; 2 mm."""
    color = np.array([[[0, 100, 255]]], np.uint8)
    assert jitter_color(color, Means(0)).tolist() == color.tolist()  # type: ignore[arg-type]
    assert jitter_color(color, Means(1)).tolist() == [[[5, int(100 * 1.04 * 1.02 + 5), 255]]]  # type: ignore[arg-type]
    assert jitter_color(color, Means(-1)).tolist() == [[[0, int(100 * 0.96 * 0.98 - 5), 234]]]  # type: ignore[arg-type]
    height = np.array([[0.0, 0.1]], np.float32)
    np.testing.assert_allclose(jitter_height(height, Means(1)), [[0.002, 0.102]], atol=1e-7)  # type: ignore[arg-type]


def test_a_transform_turns_about_the_middle_and_then_shifts() -> None:
    dice = Means(1)
    transform = draw_transform((11, 21), [], 90.0, 2.0, dice)  # type: ignore[arg-type]
    assert transform.angle == pytest.approx(math.pi / 2) and dice.asked == 2
    assert transform.pixel((5.0, 10.0)) == pytest.approx((7.0, 12.0))
    assert transform.pixel((5.0, 11.0)) == pytest.approx((8.0, 12.0))  # from columns towards rows


@pytest.mark.parametrize(
    ("pixel", "kept"), [((8, 18), True), ((9, 18), False), ((8, 19), False), ((0, 0), True), ((-3, 0), False)]
)
def test_a_transform_keeps_a_pixel_up_to_the_border(pixel: tuple[int, int], kept: bool) -> None:
    dice = Means(1)
    transform = draw_transform((11, 21), [(5, 5), pixel], 0.0, 2.0, dice)  # type: ignore[arg-type]
    assert transform.is_identity != kept and dice.asked == (2 if kept else 200)
    assert transform.pixel((1.0, 1.0)) == ((3.0, 3.0) if kept else (1.0, 1.0))


def test_a_transform_keeps_the_first_row_and_column() -> None:
    for pixel, kept in (((2, 2), True), ((1, 2), False), ((2, 1), False)):
        transform = draw_transform((11, 21), [pixel], 0.0, 2.0, Means(-1))  # type: ignore[arg-type]
        assert transform.is_identity != kept


def test_things_are_raised_and_large_enough() -> None:
    """5 mm, 60 pixels; the mask goes 3 pixels further."""
    seen = scene(
        (slice(20, 30), slice(20, 26), RED), (slice(60, 69), slice(20, 26), BLUE), (slice(0, 9), slice(90, 99), RED)
    )
    seen.height[100:110, 100:110] = 0.0049
    seen.height[150:160, 100:110] = 0.0051
    things = find_things(seen)
    assert [(_bounds(thing.mask), thing.movable) for thing in things] == [
        ((147, 97, 163, 113), True),
        ((0, 87, 12, 102), False),
        ((17, 17, 33, 29), True),
    ]
    assert raised(seen).sum() == 60 + 54 + 81 + 100


@pytest.mark.parametrize(("gap", "belongs"), [(0, True), (12, False), (13, False)])
def test_what_a_thing_hides_belongs_to_it(gap: int, belongs: bool) -> None:
    """Up to 12 pixels beside it."""
    seen = scene((slice(100, 110), slice(50, 60), RED))
    seen.valid[100:110, 60 + gap : 64 + gap] = False
    (thing,) = find_things(seen)
    assert _bounds(thing.mask) == (97, 47, 113, 67 if belongs else 63)


@pytest.mark.parametrize("angle", [0.0, math.pi / 2, -math.pi / 2, math.pi])
def test_a_thing_is_cut_out_and_turned_as_a_whole(angle: float) -> None:
    seen = scene((slice(40, 47), slice(30, 61), RED))
    seen.color[40, 30] = BLUE
    seen.valid[46, 60] = False
    mask = np.zeros(SPEC.shape, bool)
    mask[40:47, 30:61] = True
    cutout = _cut_out_turned(seen, Thing(mask, True), Means(angle))  # type: ignore[arg-type]
    turns = round(-angle / (math.pi / 2))  # rot90 goes from rows towards columns
    assert cutout.mask.shape == ((7, 31) if turns % 2 == 0 else (31, 7)) and cutout.mask.all()
    np.testing.assert_array_equal(cutout.color, np.rot90(seen.color[40:47, 30:61], turns))
    np.testing.assert_array_equal(cutout.valid, np.rot90(seen.valid[40:47, 30:61], turns))
    np.testing.assert_array_equal(cutout.height, np.full(cutout.mask.shape, np.float32(0.03)))
    assert (cutout.rows, cutout.cols) == (slice(0, cutout.mask.shape[0]), slice(0, cutout.mask.shape[1]))
    blue = np.argwhere((cutout.color == BLUE).all(2))[0]
    assert cutout.transform.pixel((40, 30)) == pytest.approx(blue, abs=0.51) and cutout.transform.angle == angle


def _cutout(height: int, width: int) -> Cutout:
    mask = np.ones((height, width), bool)
    matrix = PlanarTransform(0.5, np.array([[1.0, 0.0, 5.0], [0.0, 1.0, 7.0]]))
    none = np.zeros((height, width), np.float32)
    return Cutout(matrix, slice(0, height), slice(0, width), mask, none[..., None].astype(np.uint8), none, mask)


def test_the_one_free_place_is_found() -> None:
    taken = np.ones((6, 5), bool)
    taken[2:5, 1:3] = False
    found = _find_free_place(_cutout(3, 2), taken, np.random.default_rng(0))
    assert found is not None and (found.rows, found.cols) == (slice(2, 5), slice(1, 3))
    assert found.transform.angle == 0.5 and found.transform.matrix.tolist() == [[1, 0, 6], [0, 1, 9]]
    taken[2, 1] = True
    assert _find_free_place(_cutout(3, 2), taken, np.random.default_rng(0)) is None


@pytest.mark.parametrize(("shape", "fits"), [((6, 5), True), ((7, 5), False), ((6, 6), False), ((1, 1), True)])
def test_a_thing_as_large_as_the_picture_fits(shape: tuple[int, int], fits: bool) -> None:
    """The last row and column may be used, too."""
    places = set()
    for seed in range(40):
        found = _find_free_place(_cutout(*shape), np.zeros((6, 5), bool), np.random.default_rng(seed))
        assert (found is not None) == fits
        if found is not None:
            places.add((found.rows.stop, found.cols.stop))
    assert not fits or (max(row for row, _ in places), max(col for _, col in places)) == (6, 5)


def test_a_place_on_the_table_keeps_ten_pixels_free() -> None:
    demo = Demonstration("put the red bar there", False, (44, 45), 0.0, math.pi, (160, 80), 0.5)
    nearest = math.inf
    for seed in range(60):
        seen = scene((slice(40, 70), slice(30, 100), RED))
        moved, _ = rearranged(seen, replace(demo), np.random.default_rng(seed))
        rows, cols = np.nonzero(moved.height > 0.02)
        nearest = min(nearest, np.hypot(rows - 160, cols - 80).min())
    assert 10 < nearest < 22


def test_colours_of_a_thing_change_with_their_light() -> None:
    """The median becomes the new colour; twice its lightness is twice the new one's, and hues keep their distance."""
    pixels = np.array([[50, 10, 20], [100, 30, 40], [25, 0, 0]], np.float32)
    found = _repaint(pixels, np.array([80, -10, 5], np.float32))
    np.testing.assert_allclose(found, [[80, -10, 5], [160, -10, 10], [40, -10, -7.5]])
    dark = _repaint(np.array([[0.5, 2, 3]], np.float32), np.array([40, 2, 5], np.float32))
    np.testing.assert_allclose(dark, [[20, 2, 4]])


def test_paint_covers_what_is_like_its_shade() -> None:
    """Greys whose lightness, which counts 0.4, is less than 14 away from that of 128; only what is raised."""
    table = np.arange(256).reshape(16, 16)
    spec = WorkspaceSpec(x_min=0.0, x_max=0.16, y_min=0.0, y_max=0.16, pixel_size=0.01)
    color = np.repeat(table[..., None], 3, axis=2).astype(np.uint8)
    seen = Heightmap(color, np.full((16, 16), 0.02, np.float32), np.ones((16, 16), bool), spec)
    seen.height[8, 0] = 0.0  # of 128 itself
    shade = lab(np.array([[128, 128, 128]], np.uint8))
    painted = Repainting({}, (Paint(shade, np.array([50, 60, 0], np.float32)),)).image(seen)
    changed = (painted != color).any(2).ravel()
    unit = np.arange(256) / 255
    luminance = np.where(unit <= 0.04045, unit / 12.92, ((unit + 0.055) / 1.055) ** 2.4)
    lightness = np.where(luminance > 216 / 24389, 116 * np.cbrt(luminance) - 16, 24389 / 27 * luminance)
    near = 0.4 * np.abs(lightness - lightness[128]) < 14
    near[128] = False
    assert changed[near].mean() > 0.99 and not changed[~near].any()
    reds = painted.reshape(-1, 3).astype(int)[near]
    assert (reds[:, 0] - reds[:, 1] > 30).all()


def test_distance_counts_lightness_less() -> None:
    colors, shades = np.float32([[50, 0, 0], [0, 3, 4]]), np.float32([[60, 0, 0], [0, 0, 0], [100, 0, 0]])
    np.testing.assert_allclose(distance(colors, shades), [4, 5], rtol=1e-5)


def test_shades_that_stand_for_a_colour_are_far_apart(monkeypatch: pytest.MonkeyPatch) -> None:
    shades = np.float32([[0, 0, 0], [0, 1, 0], [0, 10, 0], [0, 4, 0], [0, 6, 0]])
    monkeypatch.setattr("cliport_policy.data.recolor._MAX_SHADES", 3)
    assert _spread(shades)[:, 1].tolist() == [0, 10, 4]
    assert _spread(shades[:2])[:, 1].tolist() == [0, 1]


@pytest.mark.parametrize(("width", "seen"), [(5, RED), (4, BLUE)])
def test_the_colour_of_a_place_is_that_of_most_of_its_patch(width: int, seen: tuple[int, int, int]) -> None:
    """7 x 7 pixels: 25 of them are more than half, 20 are not."""
    view = scene((slice(0, 320), slice(0, 160), BLUE), (slice(98, 103), slice(48, 48 + width), RED))
    np.testing.assert_allclose(_color_at(view, (100, 50)), lab(np.uint8([seen]))[0], atol=0.01)


def test_a_patch_ends_at_the_picture() -> None:
    """Of 4 x 4 pixels at the corner, 9 are red: not those on the other side."""
    view = scene((slice(0, 320), slice(0, 160), BLUE), (slice(0, 3), slice(0, 3), RED))
    np.testing.assert_allclose(_color_at(view, (0, 0)), lab(np.uint8([RED]))[0], atol=0.01)


@pytest.mark.parametrize(
    ("sentence", "named"),
    [
        ("put the red block away", {"red": RED}),
        ("take it to the blue bowl", {"blue": BLUE}),
        ("put the red block in a blue bowl", {"red": RED, "blue": BLUE}),
        ("into a blue bowl goes the red block", {"blue": BLUE, "red": RED}),
        ("put the green block in a blue bowl", {}),
        ("put the red, blue and green blocks away", {}),
        ("put it there", {}),
    ],
)
def test_colours_are_those_at_the_pick_and_at_the_place(sentence: str, named: dict[str, tuple[int, int, int]]) -> None:
    view = scene((slice(40, 60), slice(40, 60), RED), (slice(100, 130), slice(40, 70), BLUE))
    found = named_colors(Demonstration(sentence, False, (50, 50), 0.0, 1.0, (115, 55), 0.0), view)
    assert list(found) == list(named)
    for term, color in named.items():
        np.testing.assert_allclose(found[term], lab(np.uint8([color]))[0], atol=0.01)
