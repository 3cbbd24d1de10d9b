"""Sweep and fold: the hand goes down at the pick and stays low until the place (paper, appendix D)."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from cliport_core.action import PickPlaceAction, Primitive
from cliport_core.pose import PlanarPose, Pose
from cliport_core.workspace import WorkspaceSpec
from panda_executor.budget import Budget
from panda_executor.errors import BudgetSpentError, ExecutorError, InverseKinematicsError, PlanningError
from panda_executor.hand_geometry import HandShape
from panda_executor.ik import hand_down_pose, tilted
from panda_executor.motions import Motion
from panda_executor.phase import Phase
from panda_executor.ports import ShouldStop
from panda_executor.transfer import TransferPlanner
from panda_model.limits import FloatArray

_MAX_BRANCHES = 4  # of the inverse kinematics that are free and tried for one pose
_MIN_SWEEP = 1e-6  # a shorter way has no direction [m]


@dataclass(frozen=True, eq=False)
class DragPlan:
    """Motions of a drag: above the pick, down, a fold's small lift, along the table, up, and to the ready pose.

    escape: from the pick straight up again, when the fingers closed on nothing. lift: None where there is none.
    """

    go_above: Motion
    descend: Motion
    escape: Motion
    lift: Motion | None
    drag: Motion
    leave: Motion
    retreat: Motion
    opening: float  # of the fingers on the way down, and after a fold [m]

    @property
    def motions(self) -> tuple[Motion, ...]:
        """All motions in the order in which they are executed when the fingers find something."""
        lift = () if self.lift is None else (self.lift,)
        return (self.go_above, self.descend, *lift, self.drag, self.leave, self.retreat)


def broadside(action: PickPlaceAction) -> PickPlaceAction:
    """Return the action as it is carried out: a sweep's jaws stand in a line across its way, whatever yaw it names."""
    pick, place = action.pick, action.place
    dx, dy = place.x - pick.x, place.y - pick.y
    if action.primitive is not Primitive.SWEEP or not math.hypot(dx, dy) > _MIN_SWEEP:
        return action
    yaw = math.atan2(dy, dx) + math.pi / 2.0
    return replace(action, pick=replace(pick, yaw=yaw), place=replace(place, yaw=yaw))


def plan_drag(
    planner: TransferPlanner,
    action: PickPlaceAction,
    cloud: npt.NDArray[np.float32],
    workspace: WorkspaceSpec,
    start: FloatArray,
    should_stop: ShouldStop = lambda: False,
) -> DragPlan:
    """Plan a sweep (fingers closed throughout) or a fold (they close at the pick and open at the place).

    The tcp moves in a straight line at one height, turning from the pick's yaw to the place's. Where the arm cannot, a
    fold's hand turns the other way, to jaws that stand alike, or not at all: between them is a point of what is folded.

    Raises:
        PlanningError: when something tall stands in the way, or the arm cannot follow the line.
    """
    action = broadside(action)
    budget = planner.budget(should_stop)
    drag = _Drag(planner, action, cloud, workspace, start, budget)
    reason = "no approach to the start of the line is free"
    asked, *others = drag.turns()
    begun: list[tuple[FloatArray, float]] = []  # free approaches, and how the jaws are flipped there
    for lean, flip in itertools.product(planner.config.lean, (0.0, math.pi)):
        try:
            branches = planner.ik.solve_all(drag.above_pick(flip, lean), start)
        except InverseKinematicsError as error:
            reason = str(error)
            continue
        free = (branch.positions for branch in branches if drag.may_begin(branch.positions))
        for above in itertools.islice(free, _MAX_BRANCHES):
            budget.check(reason)
            plan = drag.attempt(above, flip, asked)
            if isinstance(plan, DragPlan):
                return plan
            begun.append((above, flip))
            reason = plan
    for turn, (above, flip) in itertools.product(others, begun):
        budget.check(reason)
        plan = drag.attempt(above, flip, turn)
        if isinstance(plan, DragPlan):
            return plan
    raise PlanningError(f"{action.primitive.label} from the pick to the place: {reason}")


def renewed_drag(
    planner: TransferPlanner,
    action: PickPlaceAction,
    plan: DragPlan,
    cloud: npt.NDArray[np.float32],
    workspace: WorkspaceSpec,
    start: FloatArray,
) -> DragPlan:
    """Return the plan among what a newer cloud (N, 3) [m] shows, taken with the arm at `start` (7,) [rad].

    Raises:
        TrajectoryError: when a motion does not pass any more.
    """
    return _Drag(planner, broadside(action), cloud, workspace, start, planner.budget()).renewed(plan)


class _Drag:
    """The scenes and heights of one action."""

    def __init__(
        self,
        planner: TransferPlanner,
        action: PickPlaceAction,
        cloud: npt.NDArray[np.float32],
        workspace: WorkspaceSpec,
        start: FloatArray,
        budget: Budget,
    ) -> None:
        config = planner.config
        self._motions = planner.motions_within(budget)
        self._planner, self._action, self._start, self._config = planner, action, start, config
        fold = action.primitive is Primitive.FOLD
        self._opening = config.hand.fold_opening if fold else 0.0
        self._lift = config.drag.fold_lift if fold else 0.0
        self._z = config.scene.table_z + config.hand.fingertip_below_tcp + config.drag.tip_clearance
        swept = planner.grid(cloud[~self._in_corridor(cloud)], workspace, start)
        grid = planner.grid(cloud, workspace, start)
        self._travelling = planner.scene(grid, HandShape(config.hand, margin=config.clearance))
        self._working = planner.scene(swept, HandShape(config.hand, self._opening))
        self._leaving = planner.scene(swept, HandShape(config.hand))

    def turns(self) -> tuple[float, ...]:
        """Return by how much the hand may turn on its way [rad], each once, the asked turn first."""
        asked = math.remainder(self._action.place.yaw - self._action.pick.yaw, math.tau)
        is_fold = self._action.primitive is Primitive.FOLD
        return tuple(dict.fromkeys((asked, asked + math.pi, 0.0))) if is_fold else (asked,)

    def above_pick(self, flip: float, lean: float) -> Pose:
        """Return the pose from which the hand goes down.

        flip: 0 or pi, the jaws are the same turned around; lean: see config [rad].
        """
        return self._above(self._action.pick, self._action.pick.yaw + flip, lean)

    def may_begin(self, above: FloatArray) -> bool:
        """Return whether the arm may travel to configuration `above` (7,) [rad]."""
        return self._travelling.is_valid(above)

    def attempt(self, above: FloatArray, flip: float, turn: float) -> DragPlan | str:
        """Return what `plan` does, or why it fails; BudgetSpentError, which ends all attempts, is raised."""
        try:
            return self.plan(above, flip, turn)
        except BudgetSpentError:
            raise
        except ExecutorError as error:
            return str(error)

    def plan(self, above: FloatArray, flip: float, turn: float) -> DragPlan:
        """Plan every motion of an arm that comes from configuration `above` (7,) [rad] and turns its hand by `turn`.

        Raises:
            ExecutorError: names the motion that fails.
        """
        pick, place = self._action.pick, self._action.place
        first, last = pick.yaw + flip, pick.yaw + flip + turn
        low = self._z + self._lift
        descend = self._straight(Phase.DESCEND, above, hand_down_pose(pick.x, pick.y, self._z, first), "go down")
        lift, end = None, descend.trajectory.end
        if self._lift > 0.0:
            lift = self._straight(Phase.RAISE, end, hand_down_pose(pick.x, pick.y, low, first), "lift what it holds")
            end = lift.trajectory.end
        along = self._straight(Phase.CARRY, end, hand_down_pose(place.x, place.y, low, last), "follow the line")
        leave = self._rise(along.trajectory.end, last)
        motions, ready = self._motions, self._planner.ready
        go_above = motions.travel(Phase.GO_ABOVE_PICK, self._start, above, self._travelling)
        retreat = motions.travel(Phase.RETREAT, leave.trajectory.end, ready, self._leaving)
        escape = motions.reversed(Phase.RETREAT, descend, self._working)
        return DragPlan(go_above, descend, escape, lift, along, leave, retreat, self._opening)

    def renewed(self, plan: DragPlan) -> DragPlan:
        """Return the plan among this cloud's columns. Raises TrajectoryError when a motion does not pass."""
        among, swept = self._motions.among, self._working.grid
        return replace(
            plan,
            go_above=among(plan.go_above, self._travelling.grid),
            descend=among(plan.descend, swept),
            escape=among(plan.escape, swept),
            lift=None if plan.lift is None else among(plan.lift, swept),
            drag=among(plan.drag, swept),
            leave=among(plan.leave, swept),
            retreat=among(plan.retreat, swept),
        )

    def _above(self, at: PlanarPose, yaw: float, lean: float) -> Pose:
        return tilted(hand_down_pose(at.x, at.y, self._z + self._config.approach_height, yaw), lean)

    def _rise(self, start: FloatArray, yaw: float) -> Motion:
        """Plan the rise from the line's end, leaning where the arm cannot fold enough to rise upright."""
        for lean in self._config.lean:
            above = self._above(self._action.place, yaw, lean)
            motion = self._motions.straight(Phase.RETREAT, start, above, self._working)
            if motion is not None:
                return motion
        raise PlanningError("the hand cannot rise at the end")

    def _straight(self, phase: Phase, start: FloatArray, end: Pose, what: str) -> Motion:
        speed = self._config.drag.speed if phase is Phase.CARRY else None
        motion = self._motions.straight(phase, start, end, self._working, speed)
        if motion is None:
            raise PlanningError(f"the hand cannot {what}")
        return motion

    def _in_corridor(self, points: npt.NDArray[np.float32]) -> npt.NDArray[np.bool_]:
        """Return a mask of the points (N, 3) that are low and near the line: to be moved, not avoided."""
        config = self._config
        a = np.array([self._action.pick.x, self._action.pick.y])
        line = np.array([self._action.place.x, self._action.place.y]) - a
        share = np.clip((points[:, :2] - a) @ line / max(float(line @ line), 1e-9), 0.0, 1.0)
        distance = np.linalg.norm(points[:, :2] - (a + share[:, None] * line), axis=1)
        near: npt.NDArray[np.bool_] = distance < config.drag.corridor
        return near & (points[:, 2] < config.scene.table_z + config.drag.low)
