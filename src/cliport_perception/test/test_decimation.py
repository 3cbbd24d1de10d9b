"""Smaller images: pixels and rays still belong together, edges stay sharp and holes stay holes."""

from __future__ import annotations

import numpy as np
import pytest

from cliport_core import Pose, WorkspaceSpec
from cliport_core.errors import ImageError
from cliport_perception import CameraModel
from cliport_perception.decimation import decimated_camera, decimated_color, decimated_depth
from cliport_perception.errors import CameraModelError
from cliport_perception.frame_preparation import FramePreparation
from cliport_perception.heightmap_builder import MAX_DEPTH_STEP, heightmap_from_rgbd

LARGE = CameraModel(961, 542, 540.0, 541.5, 481.0, 268.0, "plumb_bob", (0.05, -0.04, 0.001, 0.0, 0.0))
POSE = Pose.looking_at((1.25, 0.05, 0.95), (0.45, 0.0, 0.0))


@pytest.mark.parametrize("factor", [1, 2, 3, 4])
def test_a_block_looks_where_its_middle_looked(factor: int) -> None:
    small = decimated_camera(LARGE, factor)
    assert (small.width, small.height) == (961 // factor, 542 // factor)
    points = np.random.default_rng(0).uniform((-0.4, -0.3, 0.8), (0.4, 0.3, 1.5), (200, 3))
    middle = (factor - 1) / 2.0
    np.testing.assert_allclose(small.project(points) * factor + middle, LARGE.project(points), atol=1e-9)


@pytest.mark.parametrize("factor", [2])
def test_the_heightmap_is_that_of_a_camera_with_larger_pixels(cast_scene, factor: int) -> None:
    large = cast_scene(LARGE, POSE)
    prepared = FramePreparation(factor).aligned(large.color, large.depth, LARGE)
    small = cast_scene(prepared.camera, POSE)
    assert prepared.color.shape == small.color.shape and prepared.depth_m.shape == small.depth.shape
    both = np.isfinite(prepared.depth_m) & np.isfinite(small.depth)
    assert both.mean() > 0.95 * np.isfinite(small.depth).mean()
    off = np.abs(prepared.depth_m - small.depth)[both]
    assert np.percentile(off, 97.0) < 0.002
    found = heightmap_from_rgbd(*prepared, POSE, WorkspaceSpec())
    true = heightmap_from_rgbd(large.color, large.depth, LARGE, POSE, WorkspaceSpec())
    seen = found.valid & true.valid
    assert seen.mean() > 0.9 and np.percentile(np.abs(found.height - true.height)[seen], 97.0) < 0.002
    same = np.abs(found.color.astype(int) - true.color)[seen].max(axis=-1) < 10
    assert same.mean() > 0.97


@pytest.mark.parametrize("factor", [2, 3])
def test_no_depth_lies_between_two_surfaces_and_holes_stay(factor: int) -> None:
    rng = np.random.default_rng(1)
    depth = np.where(rng.random((48, 60)) < 0.5, 0.8, 1.2).astype(np.float32)
    small = decimated_depth(depth, factor)
    assert (np.minimum(np.abs(small - 0.8), np.abs(small - 1.2)) < 1e-6).all()
    whole = np.full((48, 60), 1.0, np.float32)
    whole[: 4 * factor] = np.nan
    whole[4 * factor, 0] = np.nan  # less than half a block
    small = decimated_depth(whole, factor)
    assert np.isnan(small[:4]).all() and np.isfinite(small[4:]).all()


def test_grain_is_averaged_without_a_bias() -> None:
    noisy = (1.0 + np.random.default_rng(2).normal(0.0, 0.0015, (600, 800))).astype(np.float32)
    assert MAX_DEPTH_STEP > 4 * 0.0015
    small = decimated_depth(noisy, 2)
    assert abs(small.mean() - 1.0) < 2e-5 and small.std() == pytest.approx(0.0015 / 2.0, rel=0.02)


def test_one_is_untouched_and_too_much_is_refused(box_scene) -> None:
    color, depth, camera, _ = box_scene
    prepared = FramePreparation().aligned(color, depth, camera)
    assert prepared.color is color and prepared.depth_m is depth and prepared.camera is camera
    assert decimated_color(color, 2).shape == (270, 480, 3)
    with pytest.raises(CameraModelError, match="images of 960x540 pixels cannot be decimated by 600"):
        decimated_camera(camera, 600)
    with pytest.raises(ImageError, match="depth image is"):
        FramePreparation(2).aligned(color, depth[:100], camera)
    with pytest.raises(ImageError, match="colour image is"):
        FramePreparation(2).aligned(color[:100], depth, camera)
