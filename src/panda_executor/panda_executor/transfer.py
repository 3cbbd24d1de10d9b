"""The planning of one pick and place, wholly before anything moves."""

from __future__ import annotations

import math
import time
from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from cliport_core.action import PickPlaceAction
from cliport_core.workspace import WorkspaceSpec
from panda_executor.budget import Budget
from panda_executor.config import ExecutorConfig
from panda_executor.errors import BudgetSpentError, ExecutorError, InverseKinematicsError, PlanningError
from panda_executor.grasp import Grasp, plan_grasps
from panda_executor.hand_geometry import HandShape
from panda_executor.ik import HandDownIk, hand_down_pose
from panda_executor.model import PandaModel
from panda_executor.motions import Motion, MotionBuilder
from panda_executor.obstacle_grid import ObstacleGrid
from panda_executor.phase import Phase
from panda_executor.ports import ShouldStop
from panda_executor.scene import Scene, add_table, place_camera
from panda_executor.transfer_attempts import PickPlacePlan, TransferAttempts
from panda_model.limits import FloatArray

_OWN_MARGIN = 0.008  # around the grasped object's cells: its blurred edge in the cloud [m]
_CAMERA_STILL = 1e-4  # a camera that moved less stands where it stood [m]


class TransferPlanner:
    """Plans actions against a cloud. Adds the table to the model that it is given, once.

    Args:
        clock: seconds, for the bounds on planning time.
    """

    def __init__(
        self,
        model: PandaModel,
        config: ExecutorConfig | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.config = config or ExecutorConfig()
        self.model = model
        self.clock = clock
        if not model.has_fixed_box("table"):
            add_table(model, self.config.scene)
        self.ik = HandDownIk(model)
        self.motions = MotionBuilder(model, self.ik, self.config)
        self.ready = model.arm.ready
        self._camera: FloatArray | None = None

    def place_camera(self, position: FloatArray) -> None:
        """Avoid the camera and its post from now on; position: of the optical centre (3,) [m, base frame]."""
        if self._camera is None or float(np.abs(position - self._camera).max()) > _CAMERA_STILL:
            self._camera = np.array(position)
            place_camera(self.model, self.config.scene, self._camera)

    def scene(self, grid: ObstacleGrid, hand: HandShape) -> Scene:
        """Return the surroundings with the given columns and hand."""
        return self.motions.scene(grid, hand)

    def grid(self, cloud: npt.NDArray[np.float32], workspace: WorkspaceSpec, positions: FloatArray) -> ObstacleGrid:
        """Return the columns of the cloud, without those that hold the hand itself at `positions` (7,) [rad].

        The arm stands where it stands: a column there is the hand in its own camera's view, or something that
        it already touches and must be able to leave.
        """
        scene = self.config.scene
        floor = scene.table_z + scene.floor
        grid = ObstacleGrid.from_cloud(cloud, workspace, floor, scene.grid_cell)
        rotation, translation = self.model.tcp_arrays(positions)
        body = HandShape(self.config.hand, margin=0.015).points @ rotation.T + translation
        return grid.without(body)

    def budget(self, should_stop: ShouldStop = lambda: False) -> Budget:
        """Return what one request's planning may take, from now on."""
        return Budget(self.config.planning_time, self.clock, should_stop)

    def motions_within(self, budget: Budget) -> MotionBuilder:
        """Return a builder whose motions are planned within a budget."""
        return MotionBuilder(self.model, self.ik, self.config, budget)

    def homeward(self, start: FloatArray, grid: ObstacleGrid, hand: HandShape) -> Motion:
        """Plan the way to the ready pose from wherever the arm is, `start` (7,) [rad].

        Raises:
            PlanningError: when there is no way.
        """
        return self.motions.travel(Phase.RETREAT, start, self.ready, self.scene(grid, hand))

    def plan(
        self,
        action: PickPlaceAction,
        cloud: npt.NDArray[np.float32],
        workspace: WorkspaceSpec,
        start: FloatArray,
        on_phase: Callable[[Phase, float], None] = lambda phase, progress: None,
        should_stop: ShouldStop = lambda: False,
    ) -> PickPlacePlan:
        """Plan every motion of a pick and place from configuration `start` (7,) [rad].

        Args:
            cloud: (N, 3) float32 [m, base frame]; NaN allowed.

        Raises:
            GraspError: when the cloud gives no grasp.
            PlanningError: when no grasp, branch and path was found that is valid throughout.
        """
        budget = self.budget(should_stop)
        cloud = relevant_points(cloud, workspace)
        grid = self.grid(cloud, workspace, start)
        on_phase(Phase.GRASP_PLANNING, 0.0)
        grasps = plan_grasps(cloud, action.pick, workspace, self.config.scene.table_z, self.config.grasp)
        on_phase(Phase.GRASP_PLANNING, 0.5)
        attempts = TransferAttempts(self.motions_within(budget), action, workspace, grid, start)
        reason = ""
        for grasp in grasps:
            rest = cloud[~grasp.covers(cloud, _OWN_MARGIN)]
            rest_grid = self.grid(rest, workspace, start)
            for flip in self._flips(grasp, start):
                budget.check(reason)
                try:
                    plan = attempts.plan(grasp, flip, rest, rest_grid)
                    budget.check()
                    on_phase(Phase.GRASP_PLANNING, 1.0)
                    return plan
                except BudgetSpentError:
                    raise
                except ExecutorError as error:
                    reason = reason or str(error)
        raise PlanningError(reason)

    def _flips(self, grasp: Grasp, start: FloatArray) -> list[float]:
        """Return 0 and pi, the cheaper for the arm first: the gripper is the same when turned around."""
        x, y, _ = grasp.centroid
        costs = {}
        for flip in (0.0, math.pi):
            pose = hand_down_pose(x, y, grasp.tcp_z, grasp.yaw + flip)
            try:
                costs[flip] = self.ik.solve_all(pose, start)[0].cost
            except InverseKinematicsError:
                costs[flip] = math.inf
        return sorted(costs, key=lambda flip: costs[flip])


def relevant_points(cloud: npt.NDArray[np.float32], workspace: WorkspaceSpec) -> npt.NDArray[np.float32]:
    """Return the points (N, 3) over and around the workspace; NaN are dropped."""
    border = 0.12
    near = (cloud[:, 0] > workspace.x_min - border) & (cloud[:, 0] < workspace.x_max + border)
    near &= (cloud[:, 1] > workspace.y_min - border) & (cloud[:, 1] < workspace.y_max + border)
    near &= (cloud[:, 2] > workspace.z_min - 0.02) & (cloud[:, 2] <= workspace.z_max)
    return cloud[near]
