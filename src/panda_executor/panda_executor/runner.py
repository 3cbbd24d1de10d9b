"""One request from validation to retreat, over an arm and a gripper that are handed in."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from cliport_perception.pose import PlanarPose
from cliport_perception.primitive import Outcome, Primitive
from cliport_perception.workspace import WorkspaceSpec
from panda_executor.config import ExecutorConfig
from panda_executor.drag import plan_drag
from panda_executor.errors import ExecutorError, GraspError, PlanningError, RequestError, TrajectoryError
from panda_executor.hand_geometry import MAX_OPENING, HandShape
from panda_executor.limits import FloatArray
from panda_executor.model import PandaModel
from panda_executor.motions import Motion
from panda_executor.ports import ArmPort, GripperPort, MotionStatus, ShouldStop
from panda_executor.request import Phase, PickPlaceRequest, PickPlaceResult
from panda_executor.request_check import check_cloud, check_positions, check_reach, check_request
from panda_executor.scene import Scene
from panda_executor.transfer import PickPlacePlan, TransferPlanner
from panda_executor.validation import validate_trajectory

OnPhase = Callable[[Phase, float], None]
Cloud = npt.NDArray[np.float32]

_SAME_WIDTH = 0.003  # the fingers need not close for less [m]
_PLAY = 0.0005  # nor open for less [m]
_RELEASE = 0.006  # that the fingers open at least to let go [m]


class _Ended(Exception):
    """Leaves the sequence early; never leaves this module."""

    def __init__(self, outcome: Outcome, message: str) -> None:
        super().__init__(message)
        self.outcome = outcome


class PickPlaceRunner:
    """Runs requests one at a time. Everything is planned before the first motion, and each trajectory is
    validated again, against the arm's measured position, right before it is sent.

    Args:
        planner: made for the same model; it carries the configuration unless `config` is given.
    """

    def __init__(
        self,
        model: PandaModel,
        planner: TransferPlanner | None,
        arm: ArmPort,
        gripper: GripperPort,
        config: ExecutorConfig | None = None,
    ) -> None:
        self.planner = planner or TransferPlanner(model, config)
        self.config = config or self.planner.config
        self._model, self._arm, self._gripper = model, arm, gripper
        self._limits = self.config.motion_limits(model.limits)

    def run(
        self,
        request: PickPlaceRequest,
        cloud: Cloud,
        workspace: WorkspaceSpec,
        on_phase: OnPhase = lambda phase, progress: None,
        should_stop: ShouldStop = lambda: False,
    ) -> PickPlaceResult:
        """Carry out a request; never raises for what can go wrong on the way, the outcome says it.

        Args:
            cloud: (N, 3) float32 [m, base frame], NaN allowed, as seen with the arm out of view.
            on_phase: called with each phase as it begins and the overall progress 0..1.
            should_stop: polled all the time; once true, the arm holds, a held object stays held.
        """
        return _Run(self, request, cloud, workspace, on_phase, should_stop).result()

    def go_ready(self, should_stop: ShouldStop = lambda: False) -> PickPlaceResult:
        """Move to the ready pose, out of the camera's view, avoiding itself, table and post only."""
        empty = np.full((1, 3), np.nan, dtype=np.float32)
        nothing = PickPlaceRequest(PlanarPose(0.0, 0.0, 0.0), PlanarPose(0.0, 0.0, 0.0))
        return _Run(self, nothing, empty, WorkspaceSpec(), lambda phase, progress: None, should_stop).go_ready()


class _Run:
    """The state of one request."""

    def __init__(
        self,
        runner: PickPlaceRunner,
        request: PickPlaceRequest,
        cloud: Cloud,
        workspace: WorkspaceSpec,
        on_phase: OnPhase,
        should_stop: ShouldStop,
    ) -> None:
        self._runner, self._planner, self._config = runner, runner.planner, runner.config
        self._arm, self._gripper, self._limits = runner._arm, runner._gripper, runner._limits
        self._request, self._cloud, self._workspace = request, cloud, workspace
        self._on_phase, self._should_stop = on_phase, should_stop
        self._centroid: FloatArray | None = None

    def result(self) -> PickPlaceResult:
        try:
            message = self._validated_sequence()
            outcome = Outcome.PLANNED if self._request.plan_only else Outcome.SUCCEEDED
            return self._end(outcome, message)
        except _Ended as end:
            return self._end(end.outcome, str(end))
        except RequestError as error:
            return self._end(Outcome.REJECTED, str(error))
        except (GraspError, PlanningError) as error:
            if self._should_stop():
                return self._end(Outcome.CANCELLED, "cancelled during planning; nothing moved")
            return self._end(Outcome.PLANNING_FAILED, str(error))
        except ExecutorError as error:
            return self._end(Outcome.EXECUTION_FAILED, str(error))

    def go_ready(self) -> PickPlaceResult:
        try:
            self._retreat_from_here()
            return self._end(Outcome.SUCCEEDED, "the arm is at its ready pose")
        except _Ended as end:
            return self._end(end.outcome, str(end))
        except PlanningError as error:
            return self._end(Outcome.PLANNING_FAILED, str(error))
        except ExecutorError as error:
            return self._end(Outcome.EXECUTION_FAILED, str(error))

    def _end(self, outcome: Outcome, message: str) -> PickPlaceResult:
        try:
            width = self._gripper.width()
        except ExecutorError:
            width = float("nan")
        return PickPlaceResult(outcome, message, self._centroid, width)

    def _validated_sequence(self) -> str:
        self._enter(Phase.VALIDATING)
        check_request(self._request, self._workspace)
        check_cloud(self._cloud)
        start = np.array(self._arm.joint_positions(), dtype=np.float64)
        check_positions(start)
        check_reach(self._request, self._planner.ik, start, self._config.scene.table_z)
        self._check_stop()
        if self._request.primitive is Primitive.PICK_PLACE:
            return self._pick_and_place(start)
        return self._drag(start)

    def _pick_and_place(self, start: FloatArray) -> str:
        plan = self._planner.plan(self._request, self._cloud, self._workspace, start, self._progress, self._should_stop)
        self._centroid = plan.grasp.centroid
        duration = sum(motion.trajectory.duration for motion in plan.motions)
        if self._request.plan_only:
            return f"planned {len(plan.motions)} motions of {duration:.1f} s in all; nothing moved"
        self._move(plan.go_above)
        self._enter(Phase.DESCEND)
        self._fingers(plan.grasp.opening, self._config.open_force)
        self._move(plan.descend)
        self._enter(Phase.CLOSE)
        self._fingers(0.0, self._config.grip_force)
        if self._is_empty():
            self._give_up(plan, "the fingers closed on nothing")
        self._move(plan.raise_up)
        if self._is_empty():
            self._give_up(None, "the object slipped out while it was raised")
        for motion in (plan.carry, plan.lower):
            self._move(motion, watch_load=True)
        self._enter(Phase.OPEN)
        self._let_go(plan.placement.opening)
        self._enter(Phase.RETREAT)
        self._move(plan.leave)
        self._move(plan.retreat)
        self._enter(Phase.DONE)
        return "the object was placed"

    def _drag(self, start: FloatArray) -> str:
        self._enter(Phase.GRASP_PLANNING)
        plan = plan_drag(self._planner, self._request, self._cloud, self._workspace, start, self._should_stop)
        fold = self._request.primitive is Primitive.FOLD
        name = self._request.primitive.name.lower()
        if self._request.plan_only:
            return f"planned a {name}; nothing moved"
        self._move(plan.go_above)
        self._enter(Phase.DESCEND)
        self._fingers(plan.opening, self._config.open_force)
        self._move(plan.descend)
        if fold:
            self._enter(Phase.CLOSE)
            self._fingers(0.0, self._config.grip_force)
            if self._is_empty():
                self._give_up_at(plan.opening, plan.escape, "the fingers closed on nothing")
        if plan.lift is not None:
            self._move(plan.lift)
        self._move(plan.drag, watch_load=fold)
        if fold:
            self._enter(Phase.OPEN)
            self._let_go(plan.opening)
        self._move(plan.leave)
        self._move(plan.retreat)
        self._enter(Phase.DONE)
        return f"the {name} was carried out"

    def _give_up(self, plan: PickPlacePlan | None, why: str) -> None:
        if plan is None:
            self._give_up_at(self._config.release_opening, None, why)
        else:
            escape = Motion(Phase.RETREAT, plan.raise_up.trajectory, plan.descend.scene)
            self._give_up_at(plan.grasp.opening, escape, why)

    def _give_up_at(
        self, opening: float, escape: Motion | None, why: str, outcome: Outcome = Outcome.GRASP_MISSED
    ) -> None:
        """Open, rise out of the objects, and clear the view, so that a fresh observation can be made."""
        self._enter(Phase.RETREAT)
        try:
            self._fingers(opening, self._config.open_force)
            if escape is not None:
                self._move(escape)
            self._retreat_from_here()
        except ExecutorError as error:
            why = f"{why}; the arm stays where it is: {error}"
        raise _Ended(outcome, why)

    def _retreat_from_here(self) -> None:
        start = np.array(self._arm.joint_positions(), dtype=np.float64)
        grid = self._planner.grid(self._cloud, self._workspace, start)
        self._move(self._planner.homeward(start, grid, HandShape()))

    def _move(self, motion: Motion, watch_load: bool = False) -> None:
        """Validate against where the arm is now, send, and wait for the end."""
        self._enter(motion.phase)
        here = np.array(self._arm.joint_positions(), dtype=np.float64)
        self._validate(motion, here)
        self._check_stop()
        lost = False

        def stop() -> bool:
            nonlocal lost
            lost = lost or (watch_load and self._is_empty())
            return lost or self._should_stop()

        result = self._arm.execute(motion.trajectory, stop)
        if self._should_stop():
            raise _Ended(Outcome.CANCELLED, f"cancelled during {motion.phase.name.lower()}; the arm holds")
        if lost or (watch_load and self._is_empty()):
            why = f"the object was lost during {motion.phase.name.lower()}"
            self._give_up_at(self._config.release_opening, None, why, Outcome.DROPPED)
        if result.status is not MotionStatus.SUCCEEDED:
            why = result.message or "no reason given"
            raise _Ended(
                Outcome.EXECUTION_FAILED,
                f"the arm's motion {result.status.value} during {motion.phase.name.lower()}: {why}",
            )

    def _validate(self, motion: Motion, here: FloatArray) -> None:
        scene: Scene = motion.scene
        try:
            validate_trajectory(motion.trajectory, self._limits, scene, here, self._config.start_tolerance)
        except TrajectoryError as error:
            raise _Ended(Outcome.EXECUTION_FAILED, f"{motion.phase.name.lower()} was not sent: {error}") from None

    def _fingers(self, width: float, effort: float) -> None:
        self._check_stop()
        if width > 0.0 and -_PLAY < self._gripper.width() - width < _SAME_WIDTH:
            return
        result = self._gripper.move(width, effort, self._should_stop)
        self._check_stop()
        if result.status is not MotionStatus.SUCCEEDED:
            why = result.message or "no reason given"
            raise _Ended(Outcome.EXECUTION_FAILED, f"the gripper's motion {result.status.value}: {why}")

    def _let_go(self, opening: float) -> None:
        """Open to `opening` [m], or until the fingers meet what is beside the object once it is free."""
        held = self._gripper.width()
        # what is held may be wider than it was seen
        wide = min(max(opening, held + _RELEASE), MAX_OPENING)
        try:
            self._fingers(wide, self._config.open_force)
        except _Ended as end:
            if end.outcome is not Outcome.EXECUTION_FAILED or self._gripper.width() < held + _RELEASE / 2.0:
                raise

    def _is_empty(self) -> bool:
        return self._gripper.width() < self._config.missed_width

    def _check_stop(self) -> None:
        if self._should_stop():
            raise _Ended(Outcome.CANCELLED, "cancelled; the arm holds")

    def _enter(self, phase: Phase) -> None:
        self._check_stop()
        self._progress(phase, 0.0)

    def _progress(self, phase: Phase, within: float) -> None:
        self._on_phase(phase, min((phase + within) / Phase.DONE, 1.0))
