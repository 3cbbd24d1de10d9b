"""One action from validation to retreat."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property

import numpy as np
import numpy.typing as npt

from cliport_core.action import ActionGoal, Primitive
from cliport_core.outcome import ActionResult, Outcome
from cliport_core.workspace import WorkspaceSpec
from panda_executor.drag import plan_drag
from panda_executor.errors import ExecutorError, GraspError, PlanningError, RequestError
from panda_executor.hand_geometry import HandShape
from panda_executor.motions import Motion
from panda_executor.phase import Phase
from panda_executor.request_check import check_cloud, check_poses, check_positions, check_reach
from panda_executor.run_commands import EarlyEnd, LoadLost, RunCommands
from panda_executor.transfer import TransferPlanner
from panda_executor.transfer_attempts import PickPlacePlan
from panda_model.limits import FloatArray

Cloud = npt.NDArray[np.float32]
CloudSource = Callable[[], Cloud]


class ActionRun:
    """The state of one goal, and the order of its phases."""

    def __init__(
        self,
        planner: TransferPlanner,
        commands: RunCommands,
        goal: ActionGoal,
        cloud_source: CloudSource,
        workspace: WorkspaceSpec,
    ) -> None:
        self._planner, self._commands, self._config = planner, commands, commands.config
        self._goal, self._action = goal, goal.action
        self._cloud_source, self._workspace = cloud_source, workspace
        self._centroid: FloatArray | None = None

    def result(self) -> ActionResult:
        """Run the goal to its end, whatever that is."""
        try:
            message = self._validated_sequence()
            outcome = Outcome.PLANNED if self._goal.plan_only else Outcome.SUCCEEDED
            return self._end(outcome, message)
        except EarlyEnd as end:
            return self._end(end.outcome, str(end))
        except RequestError as error:
            return self._end(Outcome.REJECTED, str(error))
        except (GraspError, PlanningError) as error:
            if self._commands.should_stop():
                return self._end(Outcome.CANCELLED, "cancelled during planning; nothing moved")
            return self._end(Outcome.PLANNING_FAILED, str(error))
        except ExecutorError as error:
            return self._end(Outcome.EXECUTION_FAILED, str(error))

    def go_ready(self) -> ActionResult:
        """Move to the ready pose."""
        try:
            self._retreat_from_here()
            return self._end(Outcome.SUCCEEDED, "the arm is at its ready pose")
        except EarlyEnd as end:
            return self._end(end.outcome, str(end))
        except PlanningError as error:
            return self._end(Outcome.PLANNING_FAILED, str(error))
        except ExecutorError as error:
            return self._end(Outcome.EXECUTION_FAILED, str(error))

    def _end(self, outcome: Outcome, message: str) -> ActionResult:
        try:
            width = self._commands.width()
        except ExecutorError:
            width = float("nan")
        if self._centroid is None:
            return ActionResult(outcome, message, None, width)
        x, y, z = (float(v) for v in self._centroid)
        return ActionResult(outcome, message, (x, y, z), width)

    @cached_property
    def _cloud(self) -> Cloud:
        return self._cloud_source()

    def _validated_sequence(self) -> str:
        self._commands.enter(Phase.VALIDATING)
        check_poses(self._action, self._workspace)
        check_cloud(self._cloud)  # what no cloud can mend has been said without waiting for one
        start = self._commands.positions()
        check_positions(start)
        check_reach(self._action, self._planner.ik, start, self._config.scene.table_z)
        self._commands.check_stop()
        if self._action.primitive is Primitive.PICK_PLACE:
            return self._pick_and_place(start)
        return self._drag(start)

    def _pick_and_place(self, start: FloatArray) -> str:
        commands = self._commands
        plan = self._planner.plan(
            self._action, self._cloud, self._workspace, start, commands.progress, commands.should_stop
        )
        self._centroid = plan.grasp.centroid
        duration = sum(motion.trajectory.duration for motion in plan.motions)
        if self._goal.plan_only:
            return f"planned {len(plan.motions)} motions of {duration:.1f} s in all; nothing moved"
        commands.move(plan.go_above)
        commands.enter(Phase.DESCEND)
        commands.move_fingers(plan.grasp.opening, self._config.open_force)
        commands.move(plan.descend)
        self._close()
        if commands.is_empty():
            self._give_up_grasp(plan)
        commands.move(plan.raise_up)
        if commands.is_empty():
            self._give_up(self._config.hand.opening, None, "the object slipped out while it was raised")
        self._carry(plan.carry)
        self._carry(plan.lower)
        self._open(plan.placement.opening)
        commands.enter(Phase.RETREAT)
        commands.move(plan.leave)
        commands.move(plan.retreat)
        commands.enter(Phase.DONE)
        return "the object was placed"

    def _drag(self, start: FloatArray) -> str:
        commands = self._commands
        commands.enter(Phase.GRASP_PLANNING)
        plan = plan_drag(self._planner, self._action, self._cloud, self._workspace, start, commands.should_stop)
        fold = self._action.primitive is Primitive.FOLD
        name = self._action.primitive.label
        if self._goal.plan_only:
            return f"planned a {name}; nothing moved"
        commands.move(plan.go_above)
        commands.enter(Phase.DESCEND)
        commands.move_fingers(plan.opening, self._config.open_force)
        commands.move(plan.descend)
        if fold:
            self._close()
            if commands.is_empty():
                self._give_up(plan.opening, plan.escape, "the fingers closed on nothing")
        if plan.lift is not None:
            commands.move(plan.lift)
        if fold:
            self._carry(plan.drag)
            self._open(plan.opening)
        else:
            commands.move(plan.drag)
        commands.move(plan.leave)
        commands.move(plan.retreat)
        commands.enter(Phase.DONE)
        return f"the {name} was carried out"

    def _close(self) -> None:
        self._commands.enter(Phase.CLOSE)
        self._commands.move_fingers(0.0, self._config.grip_force)

    def _open(self, opening: float) -> None:
        self._commands.enter(Phase.OPEN)
        self._commands.let_go(opening)

    def _carry(self, motion: Motion) -> None:
        """Move with something in the fingers; give up when it is lost."""
        try:
            self._commands.move(motion, watch_load=True)
        except LoadLost as loss:
            self._give_up(self._config.hand.opening, None, str(loss), Outcome.DROPPED)

    def _give_up_grasp(self, plan: PickPlacePlan) -> None:
        escape = Motion(Phase.RETREAT, plan.raise_up.trajectory, plan.descend.scene)
        self._give_up(plan.grasp.opening, escape, "the fingers closed on nothing")

    def _give_up(
        self, opening: float, escape: Motion | None, why: str, outcome: Outcome = Outcome.GRASP_MISSED
    ) -> None:
        """Open, rise out of the objects, and clear the view, so that a fresh observation can be made."""
        self._commands.enter(Phase.RETREAT)
        try:
            self._commands.move_fingers(opening, self._config.open_force)
            if escape is not None:
                self._commands.move(escape)
            self._retreat_from_here()
        except ExecutorError as error:
            why = f"{why}; the arm stays where it is: {error}"
        raise EarlyEnd(outcome, why)

    def _retreat_from_here(self) -> None:
        start = self._commands.positions()
        grid = self._planner.grid(self._cloud, self._workspace, start)
        self._commands.move(self._planner.homeward(start, grid, HandShape(self._config.hand)))
