"""One action from validation to retreat."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import cached_property, partial
from typing import NoReturn, TypeVar

from cliport_core.action import ActionGoal, Primitive
from cliport_core.outcome import ActionResult, Outcome
from cliport_core.workspace import WorkspaceSpec
from panda_executor.config import AfterFailure
from panda_executor.drag import DragPlan, plan_drag, renewed_drag
from panda_executor.errors import ExecutorError, GraspError, PlanningError, TrajectoryError
from panda_executor.hand_geometry import HandShape
from panda_executor.last_look import Cloud, LastLook, Look
from panda_executor.motions import Motion
from panda_executor.obstacle_grid import ObstacleGrid
from panda_executor.phase import Phase
from panda_executor.request_check import check_cloud, check_poses, check_positions, check_reach, check_table
from panda_executor.run_commands import EarlyEnd, LoadLost, RunCommands
from panda_executor.run_end import ended, result_of
from panda_executor.transfer import TransferPlanner
from panda_executor.transfer_attempts import PickPlacePlan
from panda_model.limits import FloatArray

CloudSource = Callable[[], Cloud]
P = TypeVar("P", PickPlacePlan, DragPlan)
Renew = Callable[[P, Cloud, WorkspaceSpec, FloatArray], P]  # checks a plan in a newer cloud, the arm at (7,) [rad]


class ActionRun:
    """The state of one goal, and the order of its phases."""

    def __init__(
        self,
        planner: TransferPlanner,
        commands: RunCommands,
        goal: ActionGoal,
        cloud_source: CloudSource,
        workspace: WorkspaceSpec,
        look: Look | None = None,
    ) -> None:
        self._last_look = LastLook(planner, commands, workspace, look)
        self._planner, self._commands, self._config = planner, commands, commands.config
        self._goal, self._action = goal, goal.action
        self._cloud_source, self._workspace = cloud_source, workspace
        self._centroid: FloatArray | None = None
        self._seen_at: FloatArray | None = None  # where the arm stood before its own camera (7,) [rad]; None: as now
        self._recovering = self._approved_by_person = False

    def result(self) -> ActionResult:
        """Run the goal to its end, whatever that is."""
        return self._ended(self._validated_sequence, Outcome.PLANNED if self._goal.plan_only else Outcome.SUCCEEDED)

    def go_ready(self) -> ActionResult:
        """Move to the ready pose."""

        def go() -> str:
            self._retreat_from_here()
            return "the arm is at its ready pose"

        return self._ended(go, Outcome.SUCCEEDED)

    def recover(self) -> ActionResult:
        """Move up from wherever the arm is, then to the ready pose; what is held stays held."""

        def go() -> str:
            self._go_back()
            return "the arm went back to its ready pose"

        return self._ended(go, Outcome.SUCCEEDED)

    def open(self) -> ActionResult:
        """Open the fingers where they are."""

        def go() -> str:
            self._commands.move_fingers(self._config.hand.opening, self._config.open_force)
            return "the fingers are open"

        return self._ended(go, Outcome.SUCCEEDED)

    def _ended(self, act: Callable[[], str], success: Outcome) -> ActionResult:
        """Return how `act` ended, which returns a sentence when it went well."""
        result = ended(self._commands, act, success, self._recovered)
        unseen = self._last_look.refusal
        if unseen is not None and result.outcome is Outcome.EXECUTION_FAILED:
            result = replace(result, refusal=unseen.refusal, refusal_value=unseen.value, refusal_limit=unseen.limit)
        centroid = None if self._centroid is None else tuple(self._centroid.tolist())
        return replace(result, grasp_centroid=centroid)

    def _recovered(self, end: EarlyEnd) -> ActionResult:
        """Return how a run ended that a failure cut short, after the arm went back where it is to."""
        rule = self._config.after_failure
        if not end.may_recover or not self._commands.moved or rule is AfterFailure.STAY or self._recovering:
            return self._end(end.outcome, str(end))
        try:
            if rule is AfterFailure.OPEN:
                self._commands.move_fingers(self._config.hand.opening, self._config.open_force)
            self._go_back()
        except EarlyEnd as second:
            outcome = end.outcome if second.may_recover else second.outcome
            return self._end(outcome, f"{end}; the arm did not get back: {second}")
        except ExecutorError as error:
            return self._end(end.outcome, f"{end}; the arm stays where it is: {error}")
        return self._end(end.outcome, f"{end}; the arm went back to its ready pose")

    def _go_back(self) -> None:
        self._recovering = True
        self._commands.enter(Phase.RECOVERING)
        hand = self._commands.hand_shape()
        start = self._commands.positions()
        grid = self._grid(start)
        up = self._planner.upward(start, grid, hand)
        if up is not None:
            self._commands.move(up)
        here = self._commands.positions()
        self._commands.move(replace(self._planner.homeward(here, grid, hand), phase=Phase.RECOVERING))

    def _grid(self, here: FloatArray) -> ObstacleGrid:
        """Return what was seen beside the arm, which is now at `here` (7,) [rad]."""
        seen_at = here if self._seen_at is None else self._seen_at
        return self._last_look.raised(self._planner.grid(self._cloud, self._workspace, seen_at), here)

    def _end(self, outcome: Outcome, message: str) -> ActionResult:
        return result_of(self._commands, outcome, message)

    @cached_property
    def _cloud(self) -> Cloud:
        return self._cloud_source()

    def _validated_sequence(self) -> str:
        self._commands.enter(Phase.VALIDATING)
        check_poses(self._action, self._workspace)
        check_cloud(self._cloud)  # what no cloud can mend has been said without waiting for one
        if not self._goal.plan_only:
            self._commands.check_empty()
        check_table(self._cloud, self._workspace, self._config.scene.table_z, self._config.table)
        start = self._seen_at = self._commands.positions()
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
        plan = self._approved(plan, self._planner.renewed)
        if self._goal.plan_only:
            return f"planned {len(plan.motions)} motions of {duration:.1f} s in all; nothing moved"
        commands.move(plan.go_above)
        plan = self._found_again(plan)
        self._centroid = plan.grasp.centroid
        commands.enter(Phase.DESCEND)
        commands.move_fingers(plan.grasp.opening, self._config.open_force)
        commands.move(plan.descend)
        self._close(plan.carry.scene.hand)
        if commands.is_empty():
            escape = replace(plan.raise_up, phase=Phase.RETREAT, scene=plan.descend.scene)
            self._give_up(plan.grasp.opening, escape, "the fingers closed on nothing")
        commands.move(plan.raise_up)
        if commands.has_lost():
            self._give_up(self._config.hand.opening, None, "the object slipped out while it was raised")
        self._carry(plan.carry)
        self._look_at_place(plan)
        self._carry(plan.lower)
        self._open(plan.placement.opening)
        commands.enter(Phase.RETREAT)
        commands.move(plan.leave)
        commands.move(plan.retreat)
        commands.enter(Phase.DONE)
        return "the object was placed"

    def _approved(self, plan: P, renew: Renew[P]) -> P:
        """Return the plan once it may be executed; what took a person's time is checked in a fresh cloud.

        Raises:
            RequestError: when it was not approved, or no fresh cloud comes.
            PlanningError: when it does not hold any more.
        """
        self._approved_by_person = self._commands.offer(plan.motions)
        if not self._approved_by_person:
            return plan
        self._cloud = self._cloud_source()
        check_cloud(self._cloud)
        self._seen_at = self._commands.positions()
        try:
            return renew(plan, self._cloud, self._workspace, self._seen_at)
        except ExecutorError as error:
            raise PlanningError(f"the scene changed while the plan waited for its approval: {error}") from None

    def _found_again(self, plan: PickPlacePlan) -> PickPlacePlan:
        """Return the plan for where the object is seen to be now; go back where that is too far from its place."""
        with self._going_back_if_changed():
            return self._last_look.at_object(plan, not self._approved_by_person)

    @contextmanager
    def _going_back_if_changed(self) -> Iterator[None]:
        """End the run above the object, as one that missed it, where a last look finds that the plan does not hold."""
        try:
            yield
        except (GraspError, PlanningError, TrajectoryError) as error:
            self._give_up(self._config.hand.opening, None, f"while the arm was under way {error}")

    def _look_at_place(self, plan: PickPlacePlan) -> None:
        """End the run above the place, the object still held, where it cannot be let go there any more."""
        try:
            self._last_look.at_place(plan)
        except PlanningError as error:
            why = f"the place changed while the arm was under way: {error}; what is held stays held"
            raise EarlyEnd(Outcome.EXECUTION_FAILED, why, may_recover=True) from None

    def _drag(self, start: FloatArray) -> str:
        commands = self._commands
        commands.enter(Phase.GRASP_PLANNING)
        plan = plan_drag(self._planner, self._action, self._cloud, self._workspace, start, commands.should_stop)
        fold = self._action.primitive is Primitive.FOLD
        plan = self._approved(plan, partial(renewed_drag, self._planner, self._action))
        if self._goal.plan_only:
            return f"planned a {self._action.primitive.label}; nothing moved"
        commands.move(plan.go_above)
        with self._going_back_if_changed():
            self._last_look.at_drag(plan)
        commands.enter(Phase.DESCEND)
        commands.move_fingers(plan.opening, self._config.open_force)
        commands.move(plan.descend, may_end_off=True)
        if fold:
            self._close()
            if commands.is_empty():
                self._give_up(plan.opening, plan.escape, "the fingers closed on nothing")
        if plan.lift is not None:
            commands.move(plan.lift, may_end_off=True)
        if fold:
            self._carry(plan.drag, may_end_off=True)
            self._open(plan.opening)
        else:
            commands.move(plan.drag, may_end_off=True)
        commands.move(plan.leave)
        commands.move(plan.retreat)
        commands.enter(Phase.DONE)
        return f"the {self._action.primitive.label} was carried out"

    def _close(self, load: HandShape | None = None) -> None:
        self._commands.enter(Phase.CLOSE)
        self._commands.move_fingers(0.0, self._config.grip_force, load)

    def _open(self, opening: float) -> None:
        self._commands.enter(Phase.OPEN)
        self._commands.let_go(opening)

    def _carry(self, motion: Motion, may_end_off: bool = False) -> None:
        """Move with something in the fingers; give up when it is lost."""
        try:
            self._commands.move(motion, watch_load=True, may_end_off=may_end_off)
        except LoadLost as loss:
            self._give_up(self._config.hand.opening, None, str(loss), Outcome.DROPPED)

    def _give_up(
        self, opening: float, escape: Motion | None, why: str, outcome: Outcome = Outcome.GRASP_MISSED
    ) -> NoReturn:
        """Open, rise out of the objects, and clear the view, so that a fresh observation can be made."""
        self._commands.enter(Phase.RETREAT)
        try:
            self._commands.move_fingers(opening, self._config.open_force)
            if escape is not None:
                self._commands.move(escape)
            self._retreat_from_here()
        except EarlyEnd as end:
            # After a stop by whomever nobody is to try again: that outcome goes before the miss.
            raise EarlyEnd(outcome if end.may_recover else end.outcome, f"{why}; {end}", end.may_recover) from None
        except ExecutorError as error:
            why = f"{why}; the arm stays where it is: {error}"
        raise EarlyEnd(outcome, why)

    def _retreat_from_here(self) -> None:
        start = self._commands.positions()
        self._commands.move(self._planner.homeward(start, self._grid(start), self._commands.hand_shape()))
