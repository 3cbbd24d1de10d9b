"""A check of a calibration that anyone can read: the heightmap with the model drawn over it, and numbers."""

from __future__ import annotations

import math
from typing import NamedTuple

import cv2
import numpy as np
import numpy.typing as npt

from cliport_core.heightmap import Heightmap
from cliport_core.pose import FloatArray, Pose
from cliport_core.workspace import WorkspaceSpec
from cliport_perception.calibration.board import Board
from cliport_perception.calibration.view import BoardView
from cliport_perception.camera_file import CameraCalibration
from cliport_perception.clouds import CloudBuilder, CloudRegion
from cliport_perception.errors import CalibrationError
from cliport_perception.heightmap_builder import heightmap_from_rgbd
from cliport_perception.table_watch import TablePlane, TableWatch

_ZOOM = 3  # pixels of the drawing for each of the heightmap
_NEAR_TIP = 0.06  # within which the surface nearest to the tip is sought [m]
_OFF = 0.004  # table cells farther from z = 0 are tinted [m]


class Frame(NamedTuple):
    """One frame of the camera: color (H, W, 3) RGB, depth (H, W) [m]; the gripper's tip in the base, and the board."""

    color: npt.NDArray[np.uint8]
    depth: npt.NDArray[np.float32]
    tip: FloatArray | None = None
    board: BoardView | None = None


class Verification(NamedTuple):
    """The findings of one frame.

    plane: the table's, None when too little of it is seen. tip_mm: from the gripper's tip to the nearest surface that
    the camera sees there. board: heights of the board's corners in the base frame (4,) [mm], where it is seen.
    """

    heightmap: Heightmap
    plane: TablePlane | None
    tip_mm: float | None
    board_mm: FloatArray | None

    def in_words(self) -> list[str]:
        """Return the numbers, a line each."""
        lines = []
        if self.plane is None:
            lines.append("table: too little of it is seen")
        else:
            tilt = math.degrees(math.atan(math.hypot(self.plane.slope_x, self.plane.slope_y)))
            lines.append(
                f"table: {1e3 * self.plane.height:+.1f} mm from z = 0, tilted by {tilt:.2f} degrees, "
                f"residual {1e3 * self.plane.residual:.1f} mm"
            )
        if self.tip_mm is None:
            lines.append("tip: no surface is seen near it, or no transform says where it is")
        else:
            lines.append(f"tip: the nearest surface is {self.tip_mm:.1f} mm from where the model has it")
        if self.board_mm is not None:
            heights = ", ".join(f"{height:+.1f}" for height in self.board_mm)
            lines.append(f"board: its corners are at z = {heights} mm; alike, and near 0 when it lies on the table")
        return lines


def verify(frame: Frame, calibration: CameraCalibration, workspace: WorkspaceSpec, board: Board) -> Verification:
    """Return what a frame shows under a calibration.

    Raises:
        CalibrationError: when hardly anything of the workspace is seen.
        ImageError: when an image does not have the camera's size.
    """
    camera, pose = calibration.intrinsics, calibration.camera_in_base
    heightmap = heightmap_from_rgbd(frame.color, frame.depth, camera, pose, workspace)
    if heightmap.valid_fraction < 0.01:
        raise CalibrationError("nothing of the workspace is seen: check the camera's view, and the workspace's bounds")
    plane = TableWatch(camera, pose, workspace).measure(frame.depth)
    tip_mm = None
    if frame.tip is not None:
        x, y, z = frame.tip
        region = CloudRegion(x - _NEAR_TIP, x + _NEAR_TIP, y - _NEAR_TIP, y + _NEAR_TIP)
        points = CloudBuilder(camera, pose, region).points(frame.depth)
        points = points[points[:, 2] > max(z - _NEAR_TIP, workspace.z_min + 0.03)]  # not the table's
        if len(points):
            nearest = float(np.linalg.norm(points - frame.tip, axis=1).min())
            tip_mm = 1e3 * nearest if nearest < _NEAR_TIP else None
    board_mm = None
    if frame.board is not None:
        board_mm = 1e3 * (pose @ frame.board.board_in_camera).apply(board.outline)[:, 2]
    return Verification(heightmap, plane, tip_mm, board_mm)


def draw(found: Verification, frame: Frame, calibration: CameraCalibration, board: Board) -> npt.NDArray[np.uint8]:
    """Return a picture (H, W, 3) RGB: the heightmap from above, x to the right, y down; unseen is magenta.

    Cells near the table are tinted, too high ones red, too low ones blue; the tip is a cross, the board a frame.
    """
    heightmap = found.heightmap
    picture = heightmap.color.astype(np.float32)
    height = heightmap.height
    near = heightmap.valid & (np.abs(height) < 0.03)
    for tinted, tint in ((near & (height > _OFF), (255, 60, 60)), (near & (height < -_OFF), (60, 60, 255))):
        picture[tinted] = 0.6 * picture[tinted] + 0.4 * np.array(tint, dtype=np.float32)
    picture[~heightmap.valid] = (200, 0, 200)
    large = np.repeat(np.repeat(picture.astype(np.uint8), _ZOOM, axis=0), _ZOOM, axis=1)
    if frame.board is not None:
        outline = (calibration.camera_in_base @ frame.board.board_in_camera).apply(board.outline)
        cv2.polylines(large, [_drawn(outline, heightmap.workspace)], True, (0, 255, 0), 2)
    if frame.tip is not None:
        (at,) = _drawn(frame.tip[None], heightmap.workspace)
        cv2.drawMarker(large, (int(at[0]), int(at[1])), (255, 255, 0), cv2.MARKER_CROSS, 21, 2)
    return large


def tip_of(gripper_in_base: Pose | None) -> FloatArray | None:
    """Return the position (3,) [m] of a tcp's pose."""
    return None if gripper_in_base is None else gripper_in_base.translation


def _drawn(points: FloatArray, workspace: WorkspaceSpec) -> npt.NDArray[np.int32]:
    """Return where points (N, 3) of the base frame are in the drawing, (x, y) as OpenCV wants it."""
    col = (points[:, 0] - workspace.x_min) / workspace.pixel_size * _ZOOM
    row = (points[:, 1] - workspace.y_min) / workspace.pixel_size * _ZOOM
    return np.stack([col, row], axis=-1).round().astype(np.int32)
