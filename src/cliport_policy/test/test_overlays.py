from __future__ import annotations

import cv2
import numpy as np
import pytest

from cliport_core.action import PickPlaceAction
from cliport_core.heightmap import Heightmap
from cliport_core.pose import PlanarPose
from cliport_core.workspace import WorkspaceSpec
from cliport_policy.inference import AffordanceMaps, Inference
from cliport_policy.overlays import SCALE, picture_point, render_overlay, render_scene, save_png

WORKSPACE = WorkspaceSpec()


@pytest.fixture
def heightmap() -> Heightmap:
    shape = WORKSPACE.shape
    color = np.full((*shape, 3), 100, np.uint8)
    color[WORKSPACE.xy_to_pixel(0.60, 0.30)] = (255, 0, 0)
    valid = np.ones(shape, bool)
    valid[:4, :4] = False
    return Heightmap(color, np.zeros(shape, np.float32), valid, WORKSPACE)


@pytest.fixture
def inference() -> Inference:
    pick, place = PlanarPose(0.5, 0.2, 0.0), PlanarPose(0.35, -0.25, 0.7)
    maps = []
    for pose in (pick, place):
        cells = np.zeros(WORKSPACE.shape, np.float32)
        cells[WORKSPACE.xy_to_pixel(pose.x, pose.y)] = 1.0
        maps.append(cv2.GaussianBlur(cells, (31, 31), 6))
    pixels = [WORKSPACE.xy_to_pixel(p.x, p.y) for p in (pick, place)]
    return Inference(PickPlaceAction(pick, place), pixels[0], pixels[1], 0.8, 0.7, 0.1, AffordanceMaps(*maps))


def test_the_picture_is_seen_from_behind_the_robot(heightmap: Heightmap) -> None:
    picture = render_scene(heightmap)
    assert picture.shape == (160 * SCALE, 320 * SCALE, 3)
    far_left = picture_point(WORKSPACE, 0.64, 0.39)  # +x is up, +y to the left
    assert far_left[0] < 20
    assert far_left[1] < 20
    right, down = picture_point(WORKSPACE, *WORKSPACE.pixel_to_xy(*WORKSPACE.xy_to_pixel(0.60, 0.30)))
    assert tuple(picture[down, right]) == (255, 0, 0)
    assert np.all(picture[-6:, -6:] == 40)  # unseen, at the near right: small x, small y


@pytest.mark.parametrize("kind", ["pick", "place"])
def test_heat_and_markers_are_where_they_belong(heightmap: Heightmap, inference: Inference, kind: str) -> None:
    pose = getattr(inference.action, kind)
    plain = render_overlay(heightmap, None, inference, kind)
    hot = render_overlay(heightmap, getattr(inference.maps, kind), inference, kind)
    right, down = picture_point(WORKSPACE, pose.x, pose.y)
    changed = np.abs(hot.astype(int) - plain).sum(axis=-1)
    near = np.s_[down - 60 : down + 60, right - 60 : right + 60]
    assert changed[near].sum() == changed.sum() > 0
    centre = plain[down, right]
    assert centre.argmax() == (0 if kind == "pick" else 1)


def test_the_gripper_is_drawn_along_its_closing_direction(heightmap: Heightmap, inference: Inference) -> None:
    picture = render_overlay(heightmap, None, inference, "pick")
    for x, y, drawn in ((0.54, 0.2, True), (0.46, 0.2, True), (0.5, 0.24, False), (0.5, 0.16, False)):
        right, down = picture_point(WORKSPACE, x, y)
        patch = picture[down - 2 : down + 3, right - 2 : right + 3].reshape(-1, 3)
        assert np.any(patch[:, 0] > 200) == drawn


def test_maps_without_a_peak_are_left_out(heightmap: Heightmap, inference: Inference) -> None:
    plain = render_overlay(heightmap, None, inference, "pick")
    for cells in (np.zeros(WORKSPACE.shape, np.float32), np.full(WORKSPACE.shape, np.nan, np.float32)):
        np.testing.assert_array_equal(render_overlay(heightmap, cells, inference, "pick"), plain)


def test_png_round_trip(tmp_path, heightmap: Heightmap, inference: Inference) -> None:
    picture = render_overlay(heightmap, inference.maps.pick if inference.maps else None, inference, "pick")
    save_png(tmp_path / "o.png", picture)
    back = cv2.imread(str(tmp_path / "o.png"))
    np.testing.assert_array_equal(back[..., ::-1], picture)
