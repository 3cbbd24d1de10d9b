"""The executor's ports over the simulator: motions end where they should, stop when told, and say why not."""

from collections.abc import Iterator

import numpy as np
import pytest

from cliport_benchmark.sim_arm import SimArmPort, SimGripperPort, SimMotion
from panda_executor.ports import MotionStatus
from panda_executor.trajectory import JointTrajectory
from sim_bridge.robot import ROBOT
from sim_bridge.world import SimWorld

READY = ROBOT.ready


@pytest.fixture
def motion() -> Iterator[SimMotion]:
    world = SimWorld()
    yield SimMotion(world)
    world.close()


def to(goal: np.ndarray, seconds: float, start: np.ndarray = READY) -> JointTrajectory:
    still = np.zeros((2, 7))
    return JointTrajectory(ROBOT.arm_joints, np.array([0.0, seconds]), np.stack([start, goal]), still, still)


def test_a_trajectory_ends_at_its_goal_in_its_time(motion: SimMotion) -> None:
    arm = SimArmPort(motion)
    result = arm.execute(to(READY + 0.2, 1.5), lambda: False)
    assert result.status is MotionStatus.SUCCEEDED
    np.testing.assert_allclose(arm.joint_positions(), READY + 0.2, atol=5e-3)
    assert motion.world.time < 1.8


def test_stop_brakes_on_the_way(motion: SimMotion) -> None:
    arm = SimArmPort(motion)
    result = arm.execute(to(READY + 0.4, 2.0), lambda: motion.world.time > 1.0)
    assert result.status is MotionStatus.CANCELLED
    assert motion.world.time < 1.35
    assert 0.05 < float(np.abs(arm.joint_positions() - READY).max()) < 0.35
    motion.rest(0.2)
    assert float(np.abs(motion.world.panda.state().velocities).max()) < 0.01


def test_a_jump_is_refused_with_its_reason(motion: SimMotion) -> None:
    result = SimArmPort(motion).execute(to(READY + 0.5, 2.0, start=READY + 0.3), lambda: False)
    assert result.status in (MotionStatus.ABORTED, MotionStatus.REJECTED)
    assert "rad" in result.message
    np.testing.assert_allclose(motion.world.panda.state().positions, READY, atol=1e-3)


def test_gripper_closes_on_nothing_and_opens_again(motion: SimMotion) -> None:
    gripper = SimGripperPort(motion)
    assert gripper.width() == pytest.approx(0.08, abs=1e-3)
    assert gripper.move(0.0, 20.0, lambda: False).width < 0.002
    result = gripper.move(0.06, 20.0, lambda: False)
    assert result.reached_goal and gripper.width() == pytest.approx(0.06, abs=2e-3)
    refused = gripper.move(0.2, 20.0, lambda: False)
    assert refused.status is MotionStatus.REJECTED and "0.04" in refused.message
