"""Timings of one RGB-D frame's way to cloud and heightmap, beside the plainest way to do it in NumPy."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from cliport_core import Pose, WorkspaceSpec
from cliport_perception import CameraModel
from cliport_perception.camera_health import CameraHealth, HealthLimits
from cliport_perception.frame_processor import FrameProcessor
from cliport_perception.heightmap_builder import HeightmapBuilder
from sim_bridge.rendering.camera import RgbdFrame


def frame_calls(frame: RgbdFrame, builder: HeightmapBuilder) -> list[tuple[str, Callable[[], object], int]]:
    """Return what is timed of one frame: names, calls, and how often."""
    color, depth = frame.color, frame.depth
    camera, pose, workspace = builder.camera, builder.camera_in_base, builder.workspace
    both = FrameProcessor(workspace, CameraHealth({}, HealthLimits()), heightmap_hz=0.0, points_hz=0.0)
    return [
        ("heightmap_960x540", lambda: builder.build(color, depth), 50),
        ("cloud_and_heightmap_960x540", lambda: both.process(color, depth, camera, pose, 0), 50),
        ("plain_numpy_heightmap_960x540", lambda: sort_and_scatter(color, depth, camera, pose, workspace), 30),
    ]


def sort_and_scatter(
    color: npt.NDArray[np.uint8],
    depth: npt.NDArray[np.float32],
    camera: CameraModel,
    camera_in_base: Pose,
    workspace: WorkspaceSpec,
) -> tuple[npt.NDArray[np.uint8], npt.NDArray[np.float32]]:
    """Return colour (rows, cols, 3) and height (rows, cols) [m]: points in order of height, each put into its cell.

    Unlike the heightmap builder it leaves pinholes where pixels are farther apart than cells.
    """
    rays = camera.rays() @ camera_in_base.rotation.T.astype(np.float32)
    points = (depth[..., None] * rays + camera_in_base.translation.astype(np.float32)).reshape(-1, 3)
    inside = workspace.contains(points) & (points[:, 2] >= workspace.z_min) & (points[:, 2] <= workspace.z_max)
    points, colors = points[inside], color.reshape(-1, 3)[inside]
    order = np.argsort(points[:, 2])
    row, col = workspace.to_pixels(points[order]).T
    height: npt.NDArray[np.float32] = np.zeros(workspace.shape, dtype=np.float32)
    picture: npt.NDArray[np.uint8] = np.zeros((*workspace.shape, 3), dtype=np.uint8)
    height[row, col], picture[row, col] = points[order, 2], colors[order]
    return picture, height
