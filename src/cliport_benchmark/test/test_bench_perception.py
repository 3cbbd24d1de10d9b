"""The plain way to a heightmap, beside which ours is timed, gives the same heights."""

from __future__ import annotations

import numpy as np

from cliport_benchmark.bench_perception import frame_calls, sort_and_scatter
from cliport_core import WorkspaceSpec
from cliport_perception import CameraModel
from cliport_perception.heightmap_builder import HeightmapBuilder
from sim_bridge.rendering.camera import RgbdFrame
from sim_bridge.rendering.mounting import load_mounting


def test_the_plain_way_agrees_where_it_sees_and_leaves_pinholes() -> None:
    camera, pose, workspace = CameraModel(480, 270, 270.0, 270.0, 240.0, 135.0), load_mounting(), WorkspaceSpec()
    rays = camera.rays().astype(np.float64) @ pose.rotation.T
    depth = (-pose.translation[2] / rays[..., 2]).astype(np.float32)
    color = np.random.default_rng(0).integers(1, 255, (270, 480, 3), dtype=np.uint8)
    builder = HeightmapBuilder(camera, pose, workspace)
    ours = builder.build(color, depth)
    picture, height = sort_and_scatter(color, depth, camera, pose, workspace)
    filled = picture.any(axis=-1)
    assert 0.1 < filled.mean() < ours.valid_fraction
    assert np.abs(height[filled] - ours.height[filled]).max() < 1e-3
    calls = frame_calls(RgbdFrame(color, depth, 0.0), builder)
    assert [name for name, _, _ in calls][1] == "cloud_and_heightmap_960x540"
    for _, call, _ in calls:
        call()
