"""The planning of one pick and place, wholly before anything moves."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial

import numpy as np
import numpy.typing as npt

from cliport_core.action import PickPlaceAction
from cliport_core.pose import Pose
from cliport_core.workspace import WorkspaceSpec
from panda_executor.budget import Budget
from panda_executor.config import ExecutorConfig
from panda_executor.errors import BudgetSpentError, ExecutorError, PlanningError
from panda_executor.grasp import OWN_MARGIN, Grasp, plan_grasps
from panda_executor.hand_geometry import HandShape
from panda_executor.ik import HandDownIk, hand_down_pose
from panda_executor.model import PandaModel
from panda_executor.motions import Motion, MotionBuilder
from panda_executor.object_moved import REACH, moved_problem, seen_shift
from panda_executor.obstacle_grid import ObstacleGrid
from panda_executor.phase import Phase
from panda_executor.ports import ShouldStop
from panda_executor.relevant_points import points_over
from panda_executor.scene import Scene, add_table, place_camera
from panda_executor.transfer_attempts import PickPlacePlan, TransferAttempts
from panda_model.limits import FloatArray

_HAND_MARGIN = 0.015  # columns this near to the hand where it stands are the hand, or let it go [m]
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
        self._cameras: tuple[FloatArray, ...] = ()

    def place_cameras(self, *positions: FloatArray) -> None:
        """Avoid the cameras and their posts from now on; positions: of the optical centres (3,) [m, base frame]."""
        for number, position in enumerate(positions):
            known = self._cameras[number] if number < len(self._cameras) else None
            if known is None or float(np.abs(position - known).max()) > _CAMERA_STILL:
                known = np.array(position)
                place_camera(self.model, self.config.scene, known, number + 1)
            self._cameras = (*self._cameras[:number], known, *self._cameras[number + 1 :])

    def scene(self, grid: ObstacleGrid, hand: HandShape) -> Scene:
        """Return the surroundings with the given columns and hand."""
        return self.motions.scene(grid, hand)

    def surroundings(
        self, cloud: npt.NDArray[np.float32], workspace: WorkspaceSpec, positions: FloatArray
    ) -> npt.NDArray[np.float32]:
        """Return the points (N, 3) over and around the workspace, whatever their height, without the arm's own.

        The arm stands at `positions` (7,) [rad], in its own camera's view: with its links no other point is near. The
        hand may be close to objects, so that only what is seen of it above the workspace is taken for it.
        """
        points = points_over(cloud, workspace)
        config = self.config.scene
        centres, radii = self.model.own_spheres(positions)
        over = centres[:, 0] + radii + config.own_margin > float(points[:, 0].min(initial=np.inf))
        centres, radii = centres[over], radii[over]
        lowest = float((centres[:, 2] - radii).min(initial=np.inf)) - config.own_margin
        raised = np.flatnonzero(points[:, 2] > max(lowest, config.table_z + config.floor))
        own = _within(points[raised], centres, radii + config.own_margin)
        high = np.flatnonzero(points[:, 2] > workspace.z_max)
        rotation, translation = self.model.tcp_arrays(positions)
        local = (points[high] - translation) @ rotation
        keep = np.ones(len(points), dtype=bool)
        keep[raised[own]] = False
        for box in HandShape(self.config.hand).boxes():
            grown = box.grown(config.own_margin)
            inside = ((local > np.array(grown.lower)) & (local < np.array(grown.upper))).all(axis=1)
            keep[high[inside]] = False
        return points.take(np.flatnonzero(keep), axis=0)

    def grid(self, cloud: npt.NDArray[np.float32], workspace: WorkspaceSpec, positions: FloatArray) -> ObstacleGrid:
        """Return the columns of the cloud, without those that hold the hand itself at `positions` (7,) [rad].

        The arm stood there when the cloud was taken: a column there is the hand in its own camera's view, or something
        that it touched.
        """
        return self._columns(self.surroundings(cloud, workspace, positions), workspace, positions)

    def _columns(
        self, points: npt.NDArray[np.float32], workspace: WorkspaceSpec, positions: FloatArray
    ) -> ObstacleGrid:
        scene = self.config.scene
        floor = scene.table_z + scene.floor
        grid = ObstacleGrid.from_cloud(points, workspace, floor, scene.grid_cell, self._cameras)
        return grid.without(self._hand_at(positions))

    def _hand_at(self, positions: FloatArray) -> FloatArray:
        """Return points (N, 3) [m] of the hand's surface with a margin, the arm at `positions` (7,) [rad]."""
        rotation, translation = self.model.tcp_arrays(positions)
        return HandShape(self.config.hand, margin=_HAND_MARGIN).points @ rotation.T + translation

    def _escape_scene(self, start: FloatArray, grid: ObstacleGrid, hand: HandShape) -> Scene:
        """Return the surroundings for the way out of whatever the arm stands in at `start` (7,) [rad]."""
        return self.scene(grid.without(self._hand_at(start)), hand).escaping(start)

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
        return self.motions.travel(Phase.RETREAT, start, self.ready, self._escape_scene(start, grid, hand))

    def upward(self, start: FloatArray, grid: ObstacleGrid, hand: HandShape) -> Motion | None:
        """Plan a straight way up from wherever the arm is, `start` (7,) [rad]; None where there is none."""
        here = self.model.tcp_pose(start)
        rise = np.array([0.0, 0.0, self.config.approach_height])
        scene = self._escape_scene(start, grid, hand)
        return self.motions.straight(Phase.RECOVERING, start, Pose(here.rotation, here.translation + rise), scene)

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
        around = self.surroundings(cloud, workspace, start)
        cloud = around[around[:, 2] <= workspace.z_max]
        grid = self._columns(around, workspace, start)
        on_phase(Phase.GRASP_PLANNING, 0.0)
        grasps = plan_grasps(cloud, action.pick, workspace, self.config.scene.table_z, self.config.grasp)
        on_phase(Phase.GRASP_PLANNING, 0.5)
        attempts = TransferAttempts(self.motions_within(budget), action, workspace, grid, start)
        reason = ""
        for attempt in self._tries(attempts, grasps, cloud, around, grid):
            budget.check(reason)
            try:
                plan = attempt()
            except BudgetSpentError:
                budget.check(reason)  # says what was in the way, too
                raise
            except ExecutorError as error:
                reason = reason or str(error)
                continue
            budget.check()
            on_phase(Phase.GRASP_PLANNING, 1.0)
            return plan
        raise PlanningError(reason)

    def _tries(
        self,
        attempts: TransferAttempts,
        grasps: list[Grasp],
        cloud: npt.NDArray[np.float32],
        around: npt.NDArray[np.float32],
        grid: ObstacleGrid,
    ) -> Iterator[Callable[[], PickPlacePlan]]:
        """Yield every grasp either way round, then each once more, from everywhere."""
        for grasp in grasps:
            rest = cloud[~grasp.covers(cloud, OWN_MARGIN)]
            rest_grid = self._rest_grid(around, grasp, attempts.workspace, attempts.start, grid)
            for flip in self._flips(grasp, attempts.start):
                yield partial(attempts.plan, grasp, flip, rest, rest_grid)
        for begun in attempts.begun:
            yield partial(attempts.plan_from_anywhere, begun)

    def renewed(
        self, plan: PickPlacePlan, cloud: npt.NDArray[np.float32], workspace: WorkspaceSpec, start: FloatArray
    ) -> PickPlacePlan:
        """Return the plan among what a newer cloud (N, 3) [m] shows, taken with the arm at `start` (7,) [rad].

        Raises:
            PlanningError: when the object moved.
            TrajectoryError: when a motion does not pass any more.
        """
        moved = moved_problem(cloud, plan.grasp, self.config.moved_share)
        if moved is not None:
            raise PlanningError(moved)
        around = self.surroundings(cloud, workspace, start)
        grid = self._columns(around, workspace, start)
        rest_grid = self._rest_grid(around, plan.grasp, workspace, start, grid)
        return replace(
            plan,
            go_above=self.motions.among(plan.go_above, grid),
            descend=self.motions.among(plan.descend, rest_grid),
            raise_up=self.motions.among(plan.raise_up, rest_grid),
            carry=self.motions.among(plan.carry, rest_grid),
            lower=self.motions.among(plan.lower, rest_grid),
            leave=self.motions.among(plan.leave, rest_grid),
            retreat=self.motions.among(plan.retreat, rest_grid),
        )

    def found_again(self, plan: PickPlacePlan, cloud: npt.NDArray[np.float32], follow: bool) -> PickPlacePlan:
        """Return the plan for where a later cloud (N, 3) [m] shows the object, the arm above it.

        Where it went a little, the way down to it and up from it are planned anew from where they began: the other
        motions stay as they are.

        Args:
            follow: whether the plan may be changed; False for one that a person approved.

        Raises:
            PlanningError: when it went too far, or at all where it may not be followed; when no straight way down to it
                is free.
            TrajectoryError: when the way up does not pass.
        """
        moved = moved_problem(cloud, plan.grasp, self.config.moved_share)
        if moved is not None:
            raise PlanningError(moved)
        shift = seen_shift(cloud, plan.grasp)
        if shift is None:
            raise PlanningError(f"the object moved by {100.0 * REACH:g} cm or more")
        by = np.array([*shift, 0.0])
        far = float(np.linalg.norm(by))
        if far < self.config.follow_from:
            return plan
        if not follow:
            raise PlanningError(f"the object moved by {1e3 * far:.0f} mm, and what a person approved is not changed")
        trajectory = plan.descend.trajectory
        planned = self.model.tcp_pose(trajectory.end)
        goal = Pose(planned.rotation, planned.translation + by)
        descend = self.motions.straight(Phase.DESCEND, trajectory.positions[0], goal, plan.descend.scene)
        if descend is None:
            raise PlanningError(f"the object went by {1e3 * far:.0f} mm, to where no way is free")
        raise_up = self.motions.reversed(Phase.RAISE, descend, plan.raise_up.scene)
        grasp = replace(plan.grasp, centroid=plan.grasp.centroid + by)
        return replace(plan, grasp=grasp, descend=descend, raise_up=raise_up)

    def _rest_grid(
        self,
        around: npt.NDArray[np.float32],
        grasp: Grasp,
        workspace: WorkspaceSpec,
        start: FloatArray,
        grid: ObstacleGrid,
    ) -> ObstacleGrid:
        """Return the columns of the points `around` (N, 3) [m] without the object that is grasped.

        grid: with it; where the object was seen, what is over it was seen to be free.
        """
        return replace(self._columns(around[~grasp.owns(around)], workspace, start), seen=grid.seen)

    def _flips(self, grasp: Grasp, start: FloatArray) -> list[float]:
        """Return 0 and pi, the cheaper for the arm first: the gripper is the same when turned around."""
        x, y, _ = grasp.centroid
        poses = {flip: hand_down_pose(x, y, grasp.tcp_z, grasp.yaw + flip) for flip in (0.0, math.pi)}
        costs = {flip: self.ik.near_cost(pose, start) for flip, pose in poses.items()}
        return sorted(costs, key=lambda flip: costs[flip])


def _within(points: npt.NDArray[np.float32], centres: FloatArray, radii: FloatArray) -> npt.NDArray[np.bool_]:
    """Return a mask of the points (N, 3) that lie in one of the spheres."""
    # |p - c|^2 - r^2 as one product of matrices; metres from the base, so that float64 leaves micrometres.
    p = points.astype(np.float64)
    offset = (centres**2).sum(axis=1) - radii**2
    outside = (p**2).sum(axis=1)[:, None] - 2.0 * p @ centres.T + offset
    return np.asarray((outside < 0.0).any(axis=1))
