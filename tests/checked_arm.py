"""An arm of the simulator that checks each trajectory a second time before it follows it."""

from __future__ import annotations

from typing import ClassVar

from recheck import recheck_clearance, recheck_trajectory

from cliport_benchmark import arm_hand
from cliport_benchmark.evaluate import EvaluateConfig, Evaluator
from cliport_benchmark.sim_arm import SimArmPort
from panda_executor.motions import Motion
from panda_executor.ports import MotionResult, ShouldStop
from panda_executor.run_commands import RunCommands
from panda_executor.scene import Scene
from panda_executor.trajectory import JointTrajectory

Checked = tuple[str, int, list[str]]
_VALIDATED = RunCommands._validated


class CheckedArm(SimArmPort):
    """An arm that looks at each trajectory before it follows it."""

    trajectories: ClassVar[int] = 0
    scene: ClassVar[Scene | None] = None  # of the motion that comes next: what it was validated in
    wrong: ClassVar[list[str]] = []

    def execute(self, trajectory: JointTrajectory, should_stop: ShouldStop) -> MotionResult:
        """Check, then follow."""
        names = ("times", "positions", "velocities", "accelerations")
        sent = {name: getattr(trajectory, name).tolist() for name in names}
        CheckedArm.trajectories += 1
        try:
            recheck_trajectory({"joint_names": list(trajectory.joint_names), **sent})
            assert CheckedArm.scene is not None, "it was never validated"
            recheck_clearance(trajectory, CheckedArm.scene)
        except AssertionError as error:
            CheckedArm.wrong.append(str(error))
        CheckedArm.scene = None
        return super().execute(trajectory, should_stop)


def _validated(commands: RunCommands, motion: Motion) -> JointTrajectory:
    """Validate as the executor does, and keep the scene for the second look."""
    CheckedArm.scene = motion.scene.leaving(commands.positions())
    return _VALIDATED(commands, motion)


def motions_of(task: str, first_seed: int, episodes: int) -> Checked:
    """Run some of the expert's test scenes; return the task, how many trajectories there were, and what was wrong."""
    arm_hand.SimArmPort = CheckedArm  # type: ignore[misc]
    RunCommands._validated = _validated  # type: ignore[method-assign]
    CheckedArm.trajectories, CheckedArm.wrong = 0, []
    evaluator = Evaluator(EvaluateConfig("expert", task, "test", first_seed, episodes))
    for seed in range(first_seed, first_seed + episodes):
        evaluator.run(seed)
    evaluator.world.close()
    return task, CheckedArm.trajectories, CheckedArm.wrong
