"""An arm of the simulator that checks each trajectory a second time before it follows it."""

from __future__ import annotations

from typing import ClassVar

from recheck import recheck_trajectory

from cliport_benchmark import arm_hand
from cliport_benchmark.evaluate import EvaluateConfig, Evaluator
from cliport_benchmark.sim_arm import SimArmPort
from panda_executor.ports import MotionResult, ShouldStop
from panda_executor.trajectory import JointTrajectory

Checked = tuple[str, int, list[str]]


class CheckedArm(SimArmPort):
    """An arm that looks at each trajectory before it follows it."""

    trajectories: ClassVar[int] = 0
    wrong: ClassVar[list[str]] = []

    def execute(self, trajectory: JointTrajectory, should_stop: ShouldStop) -> MotionResult:
        """Check, then follow."""
        names = ("times", "positions", "velocities", "accelerations")
        sent = {name: getattr(trajectory, name).tolist() for name in names}
        CheckedArm.trajectories += 1
        try:
            recheck_trajectory({"joint_names": list(trajectory.joint_names), **sent})
        except AssertionError as error:
            CheckedArm.wrong.append(str(error))
        return super().execute(trajectory, should_stop)


def motions_of(task: str, first_seed: int, episodes: int) -> Checked:
    """Run some of the expert's test scenes; return the task, how many trajectories there were, and what was wrong."""
    arm_hand.SimArmPort = CheckedArm  # type: ignore[misc]
    CheckedArm.trajectories, CheckedArm.wrong = 0, []
    evaluator = Evaluator(EvaluateConfig("expert", task, "test", first_seed, episodes))
    for seed in range(first_seed, first_seed + episodes):
        evaluator.run(seed)
    evaluator.world.close()
    return task, CheckedArm.trajectories, CheckedArm.wrong
