from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from cliport_core import ImageError, WorkspaceSpec
from cliport_perception.clouds import MARGIN, POINT_STEP, CloudBuilder, CloudRegion

EVERYWHERE = CloudRegion(-np.inf, np.inf, -np.inf, np.inf)
AROUND = CloudRegion.around(WorkspaceSpec())


def cloud(scene: Any, region: CloudRegion = EVERYWHERE) -> np.ndarray:
    return CloudBuilder(scene.camera, scene.camera_in_base, region).points(scene.depth)


def test_points_lie_on_the_surfaces_they_came_from(box_scene) -> None:
    seen = ~np.isnan(box_scene.depth)
    points = cloud(box_scene)
    assert points.dtype == np.float32 and len(points) == np.count_nonzero(seen)
    table = np.all(box_scene.color[seen] == (120, 110, 100), axis=-1) & (points[:, 2] > -0.01)
    assert table.any() and np.abs(points[table][:, 2]).max() < 1e-4
    exact = box_scene.camera_in_base.apply(box_scene.camera.rays() * box_scene.depth[..., None])
    np.testing.assert_allclose(points, exact[seen], atol=1e-4)


def test_only_what_is_over_and_around_the_workspace_is_kept_in_order(box_scene) -> None:
    every, kept = cloud(box_scene), cloud(box_scene, AROUND)
    workspace = WorkspaceSpec()
    x, y = every[:, 0], every[:, 1]
    near = (x >= workspace.x_min - MARGIN) & (x < workspace.x_max + MARGIN)
    near &= (y >= workspace.y_min - MARGIN) & (y < workspace.y_max + MARGIN)
    assert 0 < near.sum() < len(every)
    assert kept.tobytes() == every[near].tobytes()


def test_height_is_not_bounded(box_scene, cast_scene) -> None:
    low = cast_scene(box_scene.camera, box_scene.camera_in_base)
    low.depth[:] = 0.05  # something right before the camera, far above the workspace
    camera_x, camera_y, camera_z = box_scene.camera_in_base.translation
    beside = CloudRegion(camera_x - 0.2, camera_x + 0.2, camera_y - 0.2, camera_y + 0.2)
    points = cloud(low, beside)
    assert len(points) == low.depth.size and points[:, 2].min() > camera_z - 0.1


def test_colour_is_kept(box_scene) -> None:
    builder = CloudBuilder(box_scene.camera, box_scene.camera_in_base, AROUND)
    data = bytes(builder.build(box_scene.color, box_scene.depth))
    points = builder.points(box_scene.depth)
    packed = np.frombuffer(data, "<f4").reshape(-1, POINT_STEP // 4)
    assert packed[:, :3].tobytes() == points.tobytes()
    every = CloudBuilder(box_scene.camera, box_scene.camera_in_base, EVERYWHERE)
    colors = np.frombuffer(bytes(every.build(box_scene.color, box_scene.depth)), np.uint8).reshape(-1, POINT_STEP)
    seen = box_scene.color[~np.isnan(box_scene.depth)]
    np.testing.assert_array_equal(colors[:, 12:15], seen[:, ::-1])
    assert not colors[:, 15].any()


def test_a_cloud_keeps_its_points_when_the_next_one_is_made(box_scene) -> None:
    builder = CloudBuilder(box_scene.camera, box_scene.camera_in_base, AROUND)
    first = builder.build(box_scene.color, box_scene.depth)
    before = bytes(first)
    assert bytes(builder.build(box_scene.color[::-1], box_scene.depth + np.float32(0.01))) != before
    assert bytes(first) == before


def test_nothing_seen_is_an_empty_cloud(box_scene) -> None:
    builder = CloudBuilder(box_scene.camera, box_scene.camera_in_base, AROUND)
    nothing = np.full_like(box_scene.depth, np.nan)
    assert builder.points(nothing).shape == (0, 3) and len(builder.build(box_scene.color, nothing)) == 0


def test_images_of_another_size_are_refused(box_scene) -> None:
    builder = CloudBuilder(box_scene.camera, box_scene.camera_in_base, AROUND)
    with pytest.raises(ImageError, match="camera model says"):
        builder.build(box_scene.color, box_scene.depth[1:])
    with pytest.raises(ImageError, match="camera model says"):
        builder.build(box_scene.color[1:], box_scene.depth)
