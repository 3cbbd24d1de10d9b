"""A runner over an arm and a gripper that obey at once, and requests for it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from fake_ports import FakeArm, FakeGripper

from cliport_core.action import ActionGoal, PickPlaceAction
from cliport_core.outcome import ActionResult
from cliport_core.pose import PlanarPose
from cliport_core.workspace import WorkspaceSpec
from panda_executor.phase import Phase
from panda_executor.runner import PickPlaceRunner
from panda_executor.transfer import TransferPlanner
from panda_model import load_preset

READY_POSITIONS = load_preset().ready

PICK, PLACE = PlanarPose(0.45, 0.1, 0.3), PlanarPose(0.5, -0.2, 0.3)
GOAL = ActionGoal(PickPlaceAction(PICK, PLACE))
MOTIONS = (
    Phase.GO_ABOVE_PICK, Phase.DESCEND, Phase.RAISE, Phase.CARRY, Phase.LOWER, Phase.RETREAT, Phase.RETREAT,
)  # fmt: skip
PICK_PLACE_PHASES = tuple(Phase)[: Phase.DONE]


@dataclass
class Bench:
    """A runner with fakes, and what it said."""

    runner: PickPlaceRunner
    arm: FakeArm
    gripper: FakeGripper
    cloud: np.ndarray
    phases: list[tuple[Phase, float]]
    stop: bool = False

    def run(self, goal: ActionGoal = GOAL, cloud: np.ndarray | None = None) -> ActionResult:
        result = self.runner.run(
            goal, self.cloud if cloud is None else cloud, WorkspaceSpec(), self.on_phase, lambda: self.stop
        )
        assert result.message
        assert "\n" not in result.message
        return result

    def on_phase(self, phase: Phase, progress: float) -> None:
        self.phases.append((phase, progress))

    @property
    def commands(self) -> tuple[int, int]:
        """Number of trajectories and finger motions that were sent."""
        return len(self.arm.sent), len(self.gripper.moves)

    def entered(self) -> list[Phase]:
        order = [phase for phase, _ in self.phases]
        return [p for i, p in enumerate(order) if i == 0 or order[i - 1] is not p]


def runner_bench(planner: TransferPlanner, cloud: np.ndarray) -> Bench:
    """Return a runner whose closed hand opens, and closes on an object of 4 cm."""
    arm, gripper = FakeArm(), FakeGripper(opening=0.0)
    return Bench(PickPlaceRunner(planner.model, planner, arm, gripper), arm, gripper, cloud, [])
