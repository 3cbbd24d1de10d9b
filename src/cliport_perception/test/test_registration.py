"""Depth drawn into another camera's image: what both see is what that one would measure; the rest is unknown."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from cliport_core import Pose
from cliport_core.errors import ImageError
from cliport_perception import CameraModel
from cliport_perception.heightmap_builder import MAX_DEPTH_STEP
from cliport_perception.registration import DepthRegistration

COLOR = CameraModel(960, 540, 540.0, 540.0, 480.0, 270.0)
BENT = replace(COLOR, distortion_model="plumb_bob", distortion=(0.06, -0.05, 0.001, -0.0005, 0.0))
DEPTH = CameraModel(640, 480, 380.0, 380.0, 318.0, 242.0)
SMALL = CameraModel(320, 240, 190.0, 190.0, 159.0, 121.0)
COLOR_IN_BASE = Pose.looking_at((1.25, 0.05, 0.95), (0.45, 0.0, 0.0))
DEPTH_IN_COLOR = Pose.from_xyz_rpy((-0.05, 0.012, 0.004), (0.01, -0.02, 0.008))
EDGE = 3  # pixels of the colour camera within which a depth step may fall either way
STEP = 0.01  # [m]


def around(mask: np.ndarray, pixels: int) -> np.ndarray:
    return cv2.dilate(mask.astype(np.uint8), np.ones((2 * pixels + 1, 2 * pixels + 1), np.uint8)).astype(bool)


def edges(depth: np.ndarray) -> np.ndarray:
    far = np.where(np.isfinite(depth), depth, 9.0)
    cross = cv2.getStructuringElement(cv2.MORPH_CROSS, (3, 3))
    return np.asarray(cv2.dilate(far, cross) - cv2.erode(far, cross) > STEP)


def both_see(color_scene, depth_scene, in_color: Pose) -> tuple[np.ndarray, np.ndarray]:
    """Masks (H, W) of the colour's pixels that the depth camera sees, and of those that it surely does not see."""
    points = color_scene.camera.rays() * color_scene.depth[..., None]
    there = in_color.inverse().apply(points.reshape(-1, 3).astype(np.float64))
    pixels = np.nan_to_num(depth_scene.camera.project(there), nan=-9.0)
    row, col = np.rint(pixels).astype(int).T
    height, width = depth_scene.depth.shape
    inside = (row >= 1) & (row < height - 1) & (col >= 1) & (col < width - 1) & (there[:, 2] > 0.0)
    seen = np.full(len(there), np.nan)
    seen[inside] = depth_scene.depth[row[inside], col[inside]]
    nearer = seen < there[:, 2] - STEP
    visible = np.abs(seen - there[:, 2]) < STEP / 2.0
    beyond = (row < -2) | (row > height + 1) | (col < -2) | (col > width + 1)
    shape = color_scene.depth.shape
    return visible.reshape(shape), (nearer | beyond).reshape(shape)


@pytest.mark.parametrize(("color", "sensor"), [(COLOR, SMALL), (BENT, DEPTH)], ids=["straight", "bent"])
def test_a_scene_looks_as_the_colour_camera_would_measure_it(
    cast_scene, color: CameraModel, sensor: CameraModel
) -> None:
    true = cast_scene(color, COLOR_IN_BASE)
    raw = cast_scene(sensor, COLOR_IN_BASE @ DEPTH_IN_COLOR)
    registered = DepthRegistration(sensor, color, DEPTH_IN_COLOR).register(raw.depth)
    assert registered.shape == true.depth.shape and registered.dtype == np.float32
    near_edge = around(edges(true.depth), 3 * EDGE)
    visible, hidden = both_see(true, raw, DEPTH_IN_COLOR)
    inner = visible & ~near_edge & ~around(~visible, EDGE)
    assert inner.mean() > 0.3
    assert np.isfinite(registered[inner]).mean() > 0.999, "a seen surface has seams"
    known = inner & np.isfinite(registered)
    assert np.abs(registered - true.depth)[known].max() < 0.008, "half a pixel of a slanted table"
    assert np.abs(np.median((registered - true.depth)[known])) < 0.0005
    inner_hidden = hidden & ~around(~hidden, EDGE) & np.isfinite(true.depth)
    assert inner_hidden.sum() > 50
    assert not np.isfinite(registered[inner_hidden]).any(), "what the depth camera cannot see was made up"


def test_what_is_nearer_hides_what_is_behind_it(cast_scene) -> None:
    """Both surfaces of an occluded place are drawn onto the same pixels; the box's must win."""
    true = cast_scene(COLOR, COLOR_IN_BASE)
    wide = Pose.from_xyz_rpy((-0.15, 0.0, 0.0), (0.0, -0.1, 0.0))
    raw = cast_scene(DEPTH, COLOR_IN_BASE @ wide)
    registered = DepthRegistration(DEPTH, COLOR, wide).register(raw.depth)
    on_box = (true.color == (30, 30, 200)).all(axis=-1)
    inner = ~around(~on_box, EDGE)
    known = inner & np.isfinite(registered)
    assert known.sum() > 500
    behind = registered[known] > true.depth[known] + STEP
    assert behind.mean() < 0.002


@pytest.mark.parametrize("shift", [-0.1, 0.1])
def test_the_nearer_of_two_surfaces_in_one_pixel_wins_from_either_side(shift: float) -> None:
    """A strip before a wall moves twice as far as the wall: over what was drawn already, and under what follows."""
    depth = np.full((240, 320), 1.0, np.float32)
    depth[:, 150:170] = 0.5
    moved = DepthRegistration(SMALL, SMALL, Pose.from_xyz_rpy((shift, 0.0, 0.0), (0.0, 0.0, 0.0))).register(depth)
    by = round(SMALL.fx * shift / 0.5)
    assert (moved[:, 150 + by + 1 : 170 + by - 1] == 0.5).all()
    assert (moved[:, 60:100] == 1.0).all() and (moved[:, 230:270] == 1.0).all()


def test_holes_stay_holes_and_nothing_is_seen_beyond_the_border(cast_scene) -> None:
    raw = cast_scene(DEPTH, COLOR_IN_BASE @ DEPTH_IN_COLOR).depth
    registration = DepthRegistration(DEPTH, COLOR, DEPTH_IN_COLOR)
    whole = registration.register(raw)
    raw[200:240, 300:350] = np.nan
    raw[100, 100], raw[101, 101] = 0.0, np.inf
    holed = registration.register(raw)
    lost = np.isfinite(whole) & ~np.isfinite(holed)
    assert 0.8 < lost.sum() / (40 * 50 * (540.0 / 380.0) ** 2) < 1.05
    assert not (np.isfinite(holed) & ~np.isfinite(whole)).any()
    large = cv2.erode(lost.astype(np.uint8), np.ones((3, 3), np.uint8))  # single pixels were lost, too
    rows, cols = np.nonzero(large)
    assert np.ptp(rows) < 70 and np.ptp(cols) < 85, "one hole, where it was"
    narrow = CameraModel(300, 200, 380.0, 380.0, 150.0, 100.0)
    seen = np.isfinite(DepthRegistration(narrow, COLOR, Pose.identity()).register(np.full((200, 300), 1.0, np.float32)))
    assert seen.sum() == pytest.approx(300 * 200 * (540.0 / 380.0) ** 2, rel=0.01)
    assert seen[270 - 130 : 270 + 130, 480 - 200 : 480 + 200].all()


def test_the_same_camera_gives_its_own_picture_back(box_scene) -> None:
    same = DepthRegistration(box_scene.camera, box_scene.camera, Pose.identity()).register(box_scene.depth)
    np.testing.assert_array_equal(np.isfinite(same), np.isfinite(box_scene.depth))
    off = np.abs(same - box_scene.depth)
    assert np.nanpercentile(off, 98.0) < 1e-6 and np.nanmax(off) < MAX_DEPTH_STEP


def test_nothing_known_and_nothing_in_view_give_nothing() -> None:
    registration = DepthRegistration(SMALL, COLOR, Pose.identity())
    assert np.isnan(registration.register(np.full((240, 320), np.nan, np.float32))).all()
    behind = Pose.from_xyz_rpy((0.0, 0.0, 0.0), (0.0, np.pi, 0.0))
    assert np.isnan(DepthRegistration(SMALL, BENT, behind).register(np.full((240, 320), 1.0, np.float32))).all()


def test_depth_of_another_size_than_its_camera_info_is_named() -> None:
    with pytest.raises(ImageError, match=r"depth image is \(120, 160\), its camera_info says \(240, 320\)"):
        DepthRegistration(SMALL, COLOR, Pose.identity()).register(np.ones((120, 160), np.float32))
