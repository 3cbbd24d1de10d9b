"""A heightmap looks only where its frame shows the workspace, and is the same as if it looked everywhere."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from cliport_core import Pose, WorkspaceSpec
from cliport_core.heightmap import Heightmap
from cliport_perception import CameraModel, HeightmapBuilder, heightmap_from_rgbd
from cliport_perception.depth_noise import DepthNoise

WORKSPACE = WorkspaceSpec()


def seen_in_all_the_region(builder: HeightmapBuilder) -> HeightmapBuilder:
    """Let a builder look at every pixel of its region, whatever a frame shows there."""
    builder._window = lambda depth: (slice(0, depth.shape[0]), slice(0, depth.shape[1]))  # type: ignore[method-assign]
    return builder


def same(one: Heightmap, other: Heightmap) -> bool:
    return all(np.array_equal(getattr(one, name), getattr(other, name)) for name in ("height", "valid", "color"))


def random_view(rng: np.random.Generator) -> tuple[CameraModel, Pose]:
    distortion = ((), (0.09, -0.2, 0.0008, -0.0005, 0.08))[rng.integers(2)]
    lens = CameraModel(320, 180, *rng.uniform(140.0, 300.0, 2), 160.0, 90.0, "plumb_bob", distortion)
    eye, target = rng.uniform((0.0, -0.7, 0.4), (1.2, 0.7, 1.4)), rng.uniform((0.3, -0.3, 0.0), (0.6, 0.3, 0.1))
    return lens, Pose.looking_at(eye, target)


@pytest.mark.parametrize("seed", range(12))
def test_looking_only_where_the_workspace_is_seen_changes_nothing(seed: int) -> None:
    """Of blocks at any height, with noise, and with all that depth may be where it is unknown."""
    rng = np.random.default_rng(seed)
    lens, pose = random_view(rng)
    rows, cols = np.mgrid[0 : lens.height, 0 : lens.width] // 12
    rays = lens.rays() @ pose.rotation.T.astype(np.float32)
    step = rng.choice([-1.0, 0.012, 0.05])
    short = HeightmapBuilder(lens, pose, WORKSPACE, step)
    whole = seen_in_all_the_region(HeightmapBuilder(lens, pose, WORKSPACE, step))
    for sigma in (0.0, 0.004):  # the steps between neighbours grow with it
        blocks = rng.uniform(-0.05, 0.35, (15, 27)) * (rng.random((15, 27)) < 0.3)
        depth = (blocks[rows, cols] - pose.translation[2]) / rays[..., 2]
        depth = (depth + rng.normal(0.0, rng.choice([0.0, 0.0015, 0.01]), depth.shape)).astype(np.float32)
        unknown = rng.random(depth.shape) < 0.02
        depth[unknown] = rng.choice([np.nan, np.inf, -np.inf, 0.0, -1.0, 1e9], unknown.sum())
        color = rng.integers(0, 256, (*depth.shape, 3), dtype=np.uint8)
        for builder in (short, whole):
            builder.adapt(DepthNoise(sigma))
        found = short.build(color, depth)
        assert found.valid.any() and same(found, whole.build(color, depth))


@pytest.mark.parametrize("seed", range(4))
def test_what_only_reaches_into_the_workspace_between_two_pixels_is_seen(seed: int) -> None:
    """Small patches, unknown around them, at the sides, the floor and the top of the workspace."""
    rng = np.random.default_rng(seed)
    lens, pose = random_view(rng)
    step = 0.08
    short = HeightmapBuilder(lens, pose, WORKSPACE, step)
    whole = seen_in_all_the_region(HeightmapBuilder(lens, pose, WORKSPACE, step))
    low = np.array([WORKSPACE.x_min, WORKSPACE.y_min, WORKSPACE.z_min])
    high = np.array([WORKSPACE.x_max, WORKSPACE.y_max, WORKSPACE.z_max])
    seen = 0
    for _ in range(150):
        point, axis = rng.uniform(low, high), rng.integers(3)
        point[axis] = (low, high)[rng.integers(2)][axis]
        in_camera = pose.inverse().apply(point[None])
        row, col = lens.project(in_camera)[0].astype(int)
        depth = np.full((lens.height, lens.width), np.nan, np.float32)
        color = rng.integers(0, 256, (*depth.shape, 3), dtype=np.uint8)
        if 0 <= row < lens.height - 1 and 0 <= col < lens.width - 1:
            depth[row : row + 2, col : col + 2] = in_camera[0, 2] + rng.uniform(-step / 2, step / 2, (2, 2))
        found = short.build(color, depth)
        assert same(found, whole.build(color, depth))
        seen += bool(found.valid.any())
    assert seen > 30


def test_only_where_the_workspace_is_seen_is_looked(box_scene) -> None:
    builder = HeightmapBuilder(box_scene.camera, box_scene.camera_in_base, WORKSPACE)
    region = box_scene.depth[builder._roi]
    looked_at = region[builder._window(region)]
    assert 0 < looked_at.size < 0.7 * region.size, "the region has room for things as high as the workspace"
    nothing = np.full_like(region, np.nan)
    assert nothing[builder._window(nothing)].size == 0


def test_a_frame_shows_nothing_of_the_one_before(box_scene) -> None:
    """Each frame has another window, and all share one working memory."""
    builder = HeightmapBuilder(box_scene.camera, box_scene.camera_in_base, WORKSPACE)
    half = box_scene.depth.copy()
    half[:, half.shape[1] // 2 :] = np.nan
    for depth in (box_scene.depth, half, np.full_like(half, np.nan), half, box_scene.depth):
        fresh = HeightmapBuilder(box_scene.camera, box_scene.camera_in_base, WORKSPACE)
        assert same(builder.build(box_scene.color, depth), fresh.build(box_scene.color, depth))


def test_another_camera_pose_or_workspace_is_followed_at_once(box_scene) -> None:
    scene, moved = box_scene, Pose.looking_at((1.0, -0.4, 1.1), (0.45, 0.0, 0.0))
    settings = (
        (scene.camera, scene.camera_in_base, WORKSPACE),
        (replace(scene.camera, fx=620.0, cx=470.0), scene.camera_in_base, WORKSPACE),
        (scene.camera, moved, WORKSPACE),
        (scene.camera, scene.camera_in_base, replace(WORKSPACE, x_max=0.75, z_max=0.03)),
    )
    seen = [heightmap_from_rgbd(scene.color, scene.depth, *setting) for setting in settings for _ in range(2)]
    for setting, found in zip([s for s in settings for _ in range(2)], seen, strict=True):
        assert found.valid.any() and same(found, HeightmapBuilder(*setting).build(scene.color, scene.depth))
    assert all(not same(seen[0], other) for other in seen[2:])
