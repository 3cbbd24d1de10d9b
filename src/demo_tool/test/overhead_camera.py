"""A camera straight above the table, so that what it sees can be worked out by hand: 1 mm of the table a pixel."""

from __future__ import annotations

import numpy as np

from cliport_core.pose import Pose
from cliport_perception.camera_model import CameraModel
from demo_tool.live_view import LiveView

CAMERA = CameraModel(width=120, height=100, fx=1000.0, fy=1000.0, cx=60.0, cy=50.0)
X, Y = 0.45, 0.0  # of the table under the pixel (50, 60) [m]
# rows run along -x, columns along -y
DOWN = Pose(np.array([[0.0, -1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, -1.0]]), np.array([X, Y, 1.0]))


def view_of(heights: np.ndarray, pose: Pose = DOWN) -> LiveView:
    """Return the view of a table with heights (100, 120) [m], NaN where no depth is known."""
    depth = (1.0 - heights).astype(np.float32)
    color = np.zeros((*heights.shape, 3), np.uint8)
    return LiveView(7, 9, "camera", CAMERA, pose, (), lambda: color, lambda: depth)


def flat(height: float = 0.0) -> np.ndarray:
    """Return heights of a level table [m]."""
    return np.full((CAMERA.height, CAMERA.width), height)


def point(row: int, col: int, height: float) -> tuple[float, float, float]:
    """Return where the ray of a pixel meets a height [m, base frame]."""
    scale = (1.0 - height) / 1000.0
    return X - (row - 50) * scale, Y - (col - 60) * scale, height
