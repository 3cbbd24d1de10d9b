from __future__ import annotations

import numpy as np
import pytest

from cliport_perception import ImageError
from cliport_perception.clouds import POINT_STEP, CloudBuilder, cloud_points


def test_points_lie_on_the_surfaces_they_came_from(box_scene) -> None:
    data = CloudBuilder(box_scene.camera, box_scene.camera_in_base).build(box_scene.color, box_scene.depth)
    assert len(data) == 540 * 960 * POINT_STEP
    points = cloud_points(memoryview(data), 540, 960).reshape(540, 960, 3)
    np.testing.assert_array_equal(np.isnan(points).any(axis=-1), np.isnan(box_scene.depth))
    table = np.all(box_scene.color == (120, 110, 100), axis=-1) & (points[..., 2] > -0.01)
    assert np.nanmax(np.abs(points[table][:, 2])) < 1e-4
    exact = box_scene.camera_in_base.apply(box_scene.camera.rays() * box_scene.depth[..., None])
    np.testing.assert_allclose(points, exact, atol=1e-4)


def test_pixels_are_found_again_by_projection(box_scene) -> None:
    data = CloudBuilder(box_scene.camera, box_scene.camera_in_base).build(box_scene.color, box_scene.depth)
    points = cloud_points(memoryview(data), 540, 960).reshape(540, 960, 3)[300:310, 400:410]
    in_camera = box_scene.camera_in_base.inverse().apply(points.reshape(-1, 3))
    rows, cols = np.mgrid[300:310, 400:410]
    expected = np.stack([rows.ravel(), cols.ravel()], axis=-1)
    np.testing.assert_allclose(box_scene.camera.project(in_camera), expected, atol=0.05)


def test_the_layout_is_depth_image_procs(box_scene) -> None:
    data = bytes(CloudBuilder(box_scene.camera, box_scene.camera_in_base).build(box_scene.color, box_scene.depth))
    row, col = 300, 480
    start = (row * 960 + col) * POINT_STEP
    r, g, b = box_scene.color[row, col]
    assert data[start + 16 : start + 20] == bytes([b, g, r, 0])
    assert data[start + 12 : start + 16] == data[start + 20 : start + 24] == bytes(4)


def test_images_of_another_size_are_refused(box_scene) -> None:
    builder = CloudBuilder(box_scene.camera, box_scene.camera_in_base)
    with pytest.raises(ImageError, match="camera model says"):
        builder.build(box_scene.color, box_scene.depth[1:])
