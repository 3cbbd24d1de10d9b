"""Checks of a request before anything is planned: form, bounds, reach, and the cloud."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from cliport_core.action import PickPlaceAction
from cliport_core.outcome import Refusal
from cliport_core.pose import PlanarPose
from cliport_core.workspace import WorkspaceSpec
from panda_executor.errors import InverseKinematicsError, RequestError
from panda_executor.ik import HandDownIk, hand_down_pose
from panda_executor.table_plane import TableConfig, measure_table
from panda_model.limits import FloatArray

_REACH_HEIGHT = 0.03  # above the table, where a grasp usually is [m]


def check_poses(action: PickPlaceAction, workspace: WorkspaceSpec) -> None:
    """Check that the poses are finite and inside the workspace.

    Raises:
        RequestError: names the pose and the bounds.
    """
    for name, pose in (("pick", action.pick), ("place", action.place)):
        if not pose.is_finite():
            raise RequestError(f"the {name} pose is not finite: ({pose.x}, {pose.y}, {pose.yaw})")
        if not workspace.contains_xy(pose.x, pose.y):
            raise RequestError(
                f"the {name} ({pose.x:.3f}, {pose.y:.3f}) m is outside the workspace "
                f"x {workspace.x_min:g}..{workspace.x_max:g}, y {workspace.y_min:g}..{workspace.y_max:g} m",
                Refusal.OUTSIDE_WORKSPACE,
            )


def check_reach(action: PickPlaceAction, ik: HandDownIk, positions: FloatArray, table_z: float) -> None:
    """Check that the hand, pointing down, can be at both poses, one way round or the other.

    Raises:
        RequestError: names the pose that cannot be reached.
    """
    for name, pose in (("pick", action.pick), ("place", action.place)):
        if not _reaches(pose, ik, positions, table_z + _REACH_HEIGHT):
            raise RequestError(
                f"the {name} ({pose.x:.3f}, {pose.y:.3f}) m is out of reach with the hand pointing down",
                Refusal.OUT_OF_REACH,
            )


def _reaches(pose: PlanarPose, ik: HandDownIk, positions: FloatArray, z: float) -> bool:
    for flip in (0.0, math.pi):
        try:
            ik.solve_all(hand_down_pose(pose.x, pose.y, z, pose.yaw + flip), positions)
            return True
        except InverseKinematicsError:
            continue
    return False


def check_cloud(cloud: npt.NDArray[np.float32]) -> None:
    """Check that the cloud is (N, 3) and holds points.

    Raises:
        RequestError: says what is wrong with it.
    """
    if cloud.ndim != 2 or cloud.shape[1] != 3:
        raise RequestError(f"the cloud must have shape (N, 3), got {cloud.shape}")
    if not np.isfinite(cloud[:, 2]).any():
        raise RequestError("the point cloud holds no valid point; check the camera's depth", Refusal.NO_CLOUD)


def check_positions(positions: FloatArray) -> None:
    """Check that the arm reports seven finite joint positions [rad].

    Raises:
        RequestError: when it does not.
    """
    if positions.shape != (7,) or not np.all(np.isfinite(positions)):
        raise RequestError(
            f"the arm's joint positions are not seven finite numbers: {positions.tolist()}", Refusal.JOINT_STATES
        )


def check_table(cloud: npt.NDArray[np.float32], workspace: WorkspaceSpec, table_z: float, config: TableConfig) -> None:
    """Check that the table in the cloud (N, 3) [m] is where it is configured to be.

    A table that is hardly seen is not judged.

    Raises:
        RequestError: names the height at the workspace's worst corner, and how to mend it.
    """
    plane = measure_table(cloud, workspace, table_z, config)
    if plane is None:
        return
    off = plane.worst(workspace, table_z)
    if abs(off) > config.tolerance:
        side = "above" if off > 0.0 else "below"
        raise RequestError(
            f"the table is seen {1000.0 * abs(off):.1f} mm {side} its configured height of "
            f"{table_z:g} m (at most {1000.0 * config.tolerance:g} mm); calibrate the camera or set table_z",
            Refusal.TABLE_HEIGHT,
            off,
            config.tolerance,
        )
