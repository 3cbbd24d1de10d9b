"""Sweep and fold: the hand goes down at the pick and stays down until the place (paper, appendix D)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from cliport_perception.workspace import WorkspaceSpec
from panda_executor.errors import ExecutorError, InverseKinematicsError, PlanningError
from panda_executor.hand_geometry import FINGERTIP_BELOW_TCP, HandShape
from panda_executor.ik import hand_down_pose
from panda_executor.limits import FloatArray
from panda_executor.motions import Motion
from panda_executor.request import Phase, PickPlaceRequest, Primitive
from panda_executor.transfer import TransferPlanner, relevant_points

_PUSHED_HEIGHT = 0.06  # lower things in the hand's way are what is to be moved [m]


@dataclass(frozen=True, eq=False)
class DragPlan:
    """go_above with the hand as it is, down, along the table, up, and away to the ready pose."""

    go_above: Motion
    descend: Motion
    drag: Motion
    leave: Motion
    retreat: Motion
    opening: float  # of the fingers on the way down [m]


def plan_drag(
    planner: TransferPlanner,
    request: PickPlaceRequest,
    cloud: npt.NDArray[np.float32],
    workspace: WorkspaceSpec,
    start: FloatArray,
) -> DragPlan:
    """A sweep (fingers closed throughout) or a fold (they close at the pick and open at the place).

    The tcp moves in a straight line at table height, turning from the pick's yaw to the place's.

    Raises:
        PlanningError: when something tall stands in the way, or the arm cannot follow the line.
    """
    config = planner.config
    opening = 0.0 if request.primitive is Primitive.SWEEP else 0.04
    cloud = relevant_points(cloud, workspace)
    grid = planner.grid(cloud, workspace, start)
    free = cloud[~_in_corridor(cloud, request, config.sweep_half_width, config.scene.table_z)]
    swept = planner.grid(free, workspace, start)
    z = config.scene.table_z + max(config.sweep_height, FINGERTIP_BELOW_TCP + config.grasp.tip_clearance)
    travelling = planner.scene(grid, HandShape(margin=config.clearance))
    working = planner.scene(swept, HandShape(opening))
    # Jaws turned around are the same jaws, so the turn is at most a quarter.
    turn = (request.place.yaw - request.pick.yaw + np.pi / 2.0) % np.pi - np.pi / 2.0
    reason = "no approach to the start of the line is free"
    for flip in (0.0, np.pi):
        yaw = request.pick.yaw + flip
        above = hand_down_pose(request.pick.x, request.pick.y, z + config.approach_height, yaw)
        try:
            solutions = planner.ik.solve_all(above, start)
        except InverseKinematicsError as error:
            reason = str(error)
            continue
        for solution in solutions[:4]:
            motions = planner.motions
            down = motions.straight(
                Phase.DESCEND,
                solution.positions,
                hand_down_pose(request.pick.x, request.pick.y, z, yaw),
                working,
            )
            if down is None:
                continue
            end = hand_down_pose(request.place.x, request.place.y, z, yaw + turn)
            drag = motions.straight(Phase.CARRY, down.trajectory.end, end, working)
            if drag is None:
                reason = "the hand cannot follow the line along the table"
                continue
            up = hand_down_pose(request.place.x, request.place.y, z + config.approach_height, yaw + turn)
            leave = motions.straight(Phase.RETREAT, drag.trajectory.end, up, planner.scene(swept, HandShape(0.04)))
            if leave is None:
                reason = "the hand cannot rise at the end of the line"
                continue
            try:
                go_above = motions.travel(Phase.GO_ABOVE_PICK, start, solution.positions, travelling)
                away = motions.travel(
                    Phase.RETREAT, leave.trajectory.end, planner.ready, planner.scene(swept, HandShape())
                )
            except ExecutorError as error:
                reason = str(error)
                continue
            return DragPlan(go_above, down, drag, leave, away, opening)
    raise PlanningError(f"{request.primitive.name.lower()} from the pick to the place: {reason}")


def _in_corridor(
    points: npt.NDArray[np.float32], request: PickPlaceRequest, half_width: float, table_z: float
) -> npt.NDArray[np.bool_]:
    """Which points (N, 3) are low and near the line from pick to place: to be pushed, not avoided."""
    a = np.array([request.pick.x, request.pick.y])
    b = np.array([request.place.x, request.place.y])
    line = b - a
    share = np.clip((points[:, :2] - a) @ line / max(float(line @ line), 1e-9), 0.0, 1.0)
    distance = np.linalg.norm(points[:, :2] - (a + share[:, None] * line), axis=1)
    near: npt.NDArray[np.bool_] = (distance < half_width) & (points[:, 2] < table_z + _PUSHED_HEIGHT)
    return near
