"""The carrying out of actions, over an arm and a gripper that are handed in."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from cliport_core.action import ActionGoal, HandGoal, PickPlaceAction
from cliport_core.outcome import ActionResult
from cliport_core.pose import PlanarPose
from cliport_core.workspace import WorkspaceSpec
from panda_executor.action_run import ActionRun, CloudSource
from panda_executor.config import ExecutorConfig
from panda_executor.errors import PortError
from panda_executor.hand_content import HandContent
from panda_executor.hand_move import HandMove
from panda_executor.last_look import Cloud, Look
from panda_executor.model import PandaModel
from panda_executor.ports import ArmPort, GripperPort, ShouldStop
from panda_executor.run_commands import OnPhase, OnPlan, RunCommands
from panda_executor.transfer import TransferPlanner


class PickPlaceRunner:
    """Carries out actions one at a time.

    Everything is planned before the first motion, and each trajectory is validated again, against the arm's measured
    position, right before it is sent.

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
        self._arm, self._gripper = arm, gripper
        self._hand = HandContent(self.config.missed_width, self.config.hand.opening)
        self._limits = self.config.motion_limits(model.limits)

    def run(
        self,
        goal: ActionGoal,
        cloud: Cloud | CloudSource,
        workspace: WorkspaceSpec,
        on_phase: OnPhase = lambda phase, progress: None,
        should_stop: ShouldStop = lambda: False,
        on_plan: OnPlan = lambda motions: False,
        look: Look | None = None,
    ) -> ActionResult:
        """Run an action, or only plan it; never raises for what can go wrong on the way, the outcome says it.

        Args:
            cloud: (N, 3) float32 [m, base frame], NaN allowed, as seen with the arm out of view; or what fetches it
                once the request is known to be in order, and raises RequestError where there is none.
            on_phase: called with each phase as it begins and the overall progress 0..1.
            should_stop: polled all the time; once true, the arm holds, a held object stays held.
            on_plan: told the motions once they are planned; returns when they may be executed, or raises RequestError.
                True: that took a person's time, and the plan is checked again in a fresh cloud.
            look: returns a cloud from after the last departure, or raises RequestError; asked for before the hand goes
                down. None where nothing but the arm moves the scene: then it is not looked at again.
        """
        source = cloud if callable(cloud) else lambda: cloud
        commands = self._commands(on_phase, should_stop, on_plan)
        return ActionRun(self.planner, commands, goal, source, workspace, look).result()

    def move_hand(
        self,
        goal: HandGoal,
        cloud: Callable[[], Cloud | None],
        workspace: WorkspaceSpec,
        on_phase: OnPhase = lambda phase, progress: None,
        should_stop: ShouldStop = lambda: False,
        on_plan: OnPlan = lambda motions: False,
    ) -> ActionResult:
        """Move the hand to a pose in space, or only plan it; arguments as those of `run`, which never raises, either.

        Args:
            cloud: fetches it; None where the motion is to be blind.
        """
        return HandMove(self.planner, self._commands(on_phase, should_stop, on_plan), goal, cloud, workspace).result()

    def held_width(self) -> float | None:
        """Return how wide is what the hand holds [m]; None where that is nothing, or the joint states are old."""
        try:
            width = self._gripper.width()
        except PortError:
            return None
        return width if self._hand.holds(width) else None

    def go_ready(self, should_stop: ShouldStop = lambda: False, cloud: Cloud | None = None) -> ActionResult:
        """Move to the ready pose, out of the camera's view, with what the hand holds.

        It avoids itself, the table, the camera and its post where the planner was told of them, and what `cloud` shows.
        """
        return self._without_goal(should_stop, cloud).go_ready()

    def recover(self, should_stop: ShouldStop = lambda: False, cloud: Cloud | None = None) -> ActionResult:
        """Move up, then to the ready pose as `go_ready` does; what is held stays held."""
        return self._without_goal(should_stop, cloud).recover()

    def open(self, should_stop: ShouldStop = lambda: False) -> ActionResult:
        """Open the fingers where they are."""
        return self._without_goal(should_stop, None).open()

    def _without_goal(self, should_stop: ShouldStop, cloud: Cloud | None) -> ActionRun:
        seen = np.full((1, 3), np.nan, dtype=np.float32) if cloud is None else cloud
        nothing = ActionGoal(PickPlaceAction(PlanarPose.identity(), PlanarPose.identity()))
        commands = self._commands(lambda phase, progress: None, should_stop)
        return ActionRun(self.planner, commands, nothing, lambda: seen, WorkspaceSpec())

    def _commands(
        self, on_phase: OnPhase, should_stop: ShouldStop, on_plan: OnPlan = lambda motions: False
    ) -> RunCommands:
        return RunCommands(
            self._arm, self._gripper, self.config, self._limits, on_phase, should_stop, self._hand, on_plan
        )
