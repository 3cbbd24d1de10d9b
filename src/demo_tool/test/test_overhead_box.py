"""Targets of boxes under a camera straight above the table, worked out by hand."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest
from overhead_camera import DOWN, X, flat, point, view_of

from cliport_core.action import Primitive
from cliport_core.pose import PlanarPose, Pose
from cliport_core.workspace import WorkspaceSpec
from cliport_episodes.demonstration import PixelBox
from demo_tool.box_target import (
    BoxTarget,
    box_around,
    closing_directions,
    find_target,
    finger_outlines,
    sweep_yaw,
    table_point,
    to_pixels,
)
from demo_tool.errors import BoxError
from demo_tool.station_config import BoxConfig

SPEC, CONFIG = WorkspaceSpec(), BoxConfig()
BOX = PixelBox(30, 40, 50, 60)  # 20 x 20 pixels
SMALL = PixelBox(30, 40, 40, 50)  # 10 x 10 pixels
PAD = 0.0185  # length of the fingers' pads [m]


def target(
    heights: np.ndarray, box: PixelBox = BOX, yaw: float = 0.0, stands: bool = True, config: BoxConfig = CONFIG
) -> BoxTarget:
    return find_target(view_of(heights), box, yaw, SPEC, config, "pick", stands)


def strewn(level: float, *others: tuple[int, float], box: PixelBox = BOX) -> np.ndarray:
    """Return a table whose box is at a level but for so many pixels at each other height, from its first pixel on."""
    heights = flat()
    heights[box.top : box.bottom, box.left : box.right] = level
    rows, cols = np.mgrid[box.top : box.bottom, box.left : box.right]
    first = 0
    for count, height in others:
        heights[rows.flat[first : first + count], cols.flat[first : first + count]] = height
        first += count
    return heights


@pytest.mark.parametrize(("box", "noise", "top"), [(BOX, 3, 0.04), (BOX, 4, 0.2), (SMALL, 2, 0.04), (SMALL, 3, 0.2)])
def test_a_hundredth_of_the_points_and_at_least_two_may_be_noise_above_the_top(box, noise, top) -> None:
    found = target(strewn(0.04, (noise, 0.2), box=box), box)
    assert found.top == pytest.approx(top, abs=1e-6)


@pytest.mark.parametrize(
    ("level", "other", "counted"),
    [
        (0.1, 0.1 - PAD + 0.0005, True),
        (0.1, 0.1 - PAD - 0.0005, False),
        (0.1, 0.1 + PAD - 0.0005, True),
        (0.1, 0.1 + PAD + 0.0005, False),
        (0.015, 0.0045, True),  # near the table only what stands counts: above half the least height
        (0.015, 0.0035, False),
    ],
)
def test_the_points_that_the_pads_reach_count(level: float, other: float, counted: bool) -> None:
    found = target(strewn(level, (2, other)))
    assert len(found.pixels) == (400 if counted else 398)
    assert found.pixels[0].tolist() == ([30, 40] if counted else [30, 42])
    assert found.pixels[-1].tolist() == [49, 59]


def test_a_place_takes_the_table_too() -> None:
    found = target(strewn(0.015, (3, 0.001)), stands=False)
    assert len(found.pixels) == 400


@pytest.mark.parametrize("table_z", [0.0, 0.1])
def test_what_is_lower_than_the_least_height_is_no_object(table_z: float) -> None:
    config = BoxConfig(table_z=table_z)
    assert target(flat(table_z + 0.0082), config=config).top == pytest.approx(table_z + 0.0082, abs=1e-6)
    words = "its highest point is 7 mm above the table (at least 8 mm needed); draw the box around an object"
    with pytest.raises(BoxError, match=re.escape(words)):
        target(flat(table_z + 0.0074), config=config)


@pytest.mark.parametrize(
    ("box", "needed"), [(PixelBox(10, 10, 14, 14), 12), (SMALL, 20), (PixelBox(10, 10, 18, 18), 13)]
)
def test_a_box_needs_twelve_points_and_a_fifth_of_its_own(box: PixelBox, needed: int) -> None:
    size = (box.bottom - box.top) * (box.right - box.left)
    assert len(target(strewn(math.nan, (needed, 0.04), box=box), box).pixels) == needed
    words = f"the depth of {needed - 1} of the {size} pixels in the pick box (at least {needed} needed)"
    with pytest.raises(BoxError, match=re.escape(words)):
        target(strewn(math.nan, (needed - 1, 0.04), box=box), box)


def test_the_centroid_counts_each_cell_of_the_ground_once() -> None:
    rows, cols = np.mgrid[BOX.top : BOX.bottom, BOX.left : BOX.right]
    heights = strewn(0.04)
    heights[BOX.top : BOX.bottom, BOX.left : BOX.right] += 1e-4 * (cols - BOX.left)
    cells: dict[tuple[int, int], list[tuple[float, float, float]]] = {}
    for row, col in zip(rows.flat, cols.flat, strict=True):
        x, y, z = point(row, col, float(heights[row, col]))
        cells.setdefault((math.floor(x / 0.0025), math.floor(y / 0.0025)), []).append((x, y, z))
    assert len({len(points) for points in cells.values()}) > 1, "cells hold different numbers of points"
    expected = np.mean([np.mean(points, axis=0) for points in cells.values()], axis=0)
    assert target(heights).centroid == pytest.approx(expected, abs=1e-6)


@pytest.mark.parametrize("degrees", [0, 30, 90])
def test_the_width_is_along_the_closing_direction(degrees: int) -> None:
    box, yaw = PixelBox(30, 40, 40, 60), math.radians(degrees)
    found = target(flat(), box, yaw, stands=False)
    assert found.width == pytest.approx(0.009 * math.cos(yaw) + 0.019 * math.sin(yaw), abs=1e-6)
    assert found.pose(yaw) == PlanarPose(float(found.centroid[0]), float(found.centroid[1]), yaw)


def test_a_centroid_outside_the_workspace_is_said_with_its_bounds() -> None:
    spec = WorkspaceSpec(x_min=0.45, x_max=0.65)
    find_target(view_of(flat()), BOX, 0.0, spec, CONFIG, "place", False)
    words = "the place (0.431, -0.0"
    with pytest.raises(BoxError, match=re.escape(words)) as refusal:
        find_target(view_of(flat()), PixelBox(60, 60, 80, 80), 0.0, spec, CONFIG, "place", False)
    assert str(refusal.value).endswith("m is outside the workspace, which spans x 0.45..0.65, y -0.4..0.4 m")


@pytest.mark.parametrize(("count", "drawn"), [(12, 12), (400, 400), (401, 201), (1000, 334)])
def test_at_most_four_hundred_pixels_are_drawn(count: int, drawn: int) -> None:
    pixels = np.column_stack([np.arange(count), 2 * np.arange(count)])
    shown = BoxTarget(np.zeros(3), pixels, 0.0, 0.0).shown_pixels()
    step = -(-count // 400)
    assert len(shown) == drawn and shown[:2] == [[0, 0], [step, 2 * step]]


@pytest.mark.parametrize(
    ("primitive", "inner"), [(Primitive.PICK_PLACE, 40.0), (Primitive.SWEEP, 0.0), (Primitive.FOLD, 15.0)]
)
def test_the_fingers_are_drawn_open_as_the_primitive_has_them(primitive: Primitive, inner: float) -> None:
    outlines = finger_outlines(view_of(flat()), PlanarPose(X, 0.0, 0.0), 0.0, CONFIG.hand, primitive)
    outer = inner + 15.2
    expected = []
    for side in (1.0, -1.0):  # the finger nearer to the robot is lower on the picture
        near, far = 50.0 + side * inner, 50.0 + side * outer
        expected.append([[near, 70.5], [near, 49.5], [far, 49.5], [far, 70.5]])
    assert np.allclose(outlines, expected, atol=0.051)


def test_the_fingers_turn_with_the_hand() -> None:
    outlines = np.array(finger_outlines(view_of(flat()), PlanarPose(X, 0.0, math.pi / 2), 0.0, CONFIG.hand))
    assert np.allclose(outlines[0].mean(axis=0), [50.0, 60.0 + 40.0 + 7.6], atol=0.1)
    assert np.allclose(np.ptp(outlines[0], axis=0), [21.0, 15.2], atol=0.11)


def test_closing_directions_have_length_one() -> None:
    directions = closing_directions(view_of(flat()), X, 0.0, 0.0, 8)
    angles = [math.tau * index / 8 for index in range(8)]
    assert np.allclose(directions, [(-math.cos(a), -math.sin(a)) for a in angles], atol=1e-4)


@pytest.mark.parametrize(
    ("way", "yaw"),
    [
        ((0.1, 0.0), math.pi / 2),
        ((-0.1, 0.0), math.pi / 2),
        ((0.0, 0.1), 0.0),
        ((0.1, 0.1), 3 * math.pi / 4),
        ((-0.1, 0.1), math.pi / 4),
        ((0.0, 0.0), None),
        ((5e-7, 0.0), None),
        ((2e-6, 0.0), math.pi / 2),
    ],
)
def test_the_jaws_of_a_sweep_are_across_its_way(way: tuple[float, float], yaw: float | None) -> None:
    start = PlanarPose(0.0, 0.0, 0.3)
    found = sweep_yaw(start, PlanarPose(*way, 0.0))
    assert found is None if yaw is None else found == pytest.approx(yaw, abs=1e-9)


def test_the_table_in_the_middle_of_a_box() -> None:
    view = view_of(flat())
    assert table_point(view, PixelBox(20, 30, 31, 41), 0.0) == pytest.approx(point(25, 35, 0.0))
    assert table_point(view, PixelBox(20, 30, 30, 40), 0.2) == pytest.approx(point(25, 35, 0.2))


@pytest.mark.parametrize("forward", [(0.0, 0.0, 1.0), (1.0, 0.0, 0.0)])
def test_a_camera_that_sees_no_table_gives_its_own_place(forward: tuple[float, float, float]) -> None:
    z = np.array(forward)
    x = np.array([0.0, 1.0, 0.0])
    pose = Pose(np.column_stack([x, np.cross(z, x), z]), np.array([0.1, 0.2, 1.0]))
    middle = PixelBox(49, 59, 51, 61)  # whose ray is the optical axis
    assert table_point(view_of(flat(), pose), middle, 0.0) == pytest.approx([0.1, 0.2, 1.0])


@pytest.mark.parametrize(
    ("x", "y", "edge", "box"),
    [
        (0.45, 0.0, 0.02, PixelBox(40, 50, 60, 70)),
        (0.46, -0.02, 0.02, PixelBox(30, 70, 50, 90)),
        (0.49, 0.05, 0.04, PixelBox(0, 0, 30, 30)),  # cut off by the picture's corner
        (0.41, -0.05, 0.04, PixelBox(70, 90, 100, 120)),
        (0.45, 0.09, 0.04, None),
        (0.55, 0.0, 0.04, None),
    ],
)
def test_a_square_of_the_table_as_a_box(x: float, y: float, edge: float, box: PixelBox | None) -> None:
    assert box_around(view_of(flat()), PlanarPose(x, y, 0.4), edge, 0.0) == box


def test_a_square_above_the_table_is_larger() -> None:
    assert box_around(view_of(flat()), PlanarPose(0.45, 0.0, 0.0), 0.02, 0.5) == PixelBox(30, 40, 70, 80)


def test_pixels_have_one_decimal_and_are_numbers_in_the_cameras_plane() -> None:
    view = view_of(flat())
    assert to_pixels(view, np.array([[0.44988, 0.00012, 0.0]])) == [[50.1, 59.9]]
    beside = DOWN.translation + np.array([0.1, 0.1, 0.0])  # at no depth
    assert np.isfinite(to_pixels(view, beside[None])).all()
