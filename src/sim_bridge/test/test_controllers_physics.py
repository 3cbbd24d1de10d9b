"""The controllers on the simulated Panda: following, and holding a block by friction alone."""

import numpy as np
import pybullet
import pytest

from cliport_core import PlanarPose, Pose
from sim_bridge.control import (
    GoalStatus,
    GripperController,
    GripperGoal,
    JointTrajectoryController,
    TrajectoryGoal,
)
from sim_bridge.objects import block_shape
from sim_bridge.robot import ROBOT
from sim_bridge.world import SimWorld


class Rig:
    """Steps a world with both controllers in the loop."""

    def __init__(self):
        self.world = SimWorld()
        self.arm = JointTrajectoryController()
        self.hand = GripperController()
        self.errors = []

    def run(self, seconds, execution=None):
        end = self.world.time + seconds
        while self.world.time < end and not (execution is not None and execution.done):
            panda, now = self.world.panda, self.world.time
            state = panda.state()
            arm, fingers = self.arm.update(now, state), self.hand.update(now, state)
            self.errors.append(np.abs(arm.positions - state.positions).max())
            panda.command(arm.positions, arm.velocities)
            panda.command_fingers(fingers.width, fingers.max_effort)
            self.world.step()


@pytest.fixture
def rig():
    rig = Rig()
    yield rig
    rig.world.close()


def sweep(shift, seconds):
    """Return a quintic from rest to rest, from the ready pose by `shift` (7,) [rad]."""
    start = ROBOT.ready
    zeros = np.zeros((2, 7))
    names = JointTrajectoryController().config.joint_names
    return TrajectoryGoal.from_arrays(names, [0.0, seconds], [start, start + shift], zeros, zeros)


def test_the_panda_follows_closely(rig):
    rig.run(0.2)
    execution = rig.arm.start(sweep(np.array([0.6, 0.3, -0.4, 0.5, 0.5, -0.5, 0.8]), 1.2), rig.world.time)
    rig.run(3.0, execution)
    assert execution.status is GoalStatus.SUCCEEDED, execution.error_string
    assert max(rig.errors) < 0.03
    assert rig.world.panda.state().positions == pytest.approx(rig.arm.feedback().desired.positions, abs=0.01)


def test_cancel_stops_the_panda(rig):
    rig.run(0.2)
    execution = rig.arm.start(sweep(np.array([1.0, 0, 0, 0, 0, 0, 0]), 1.2), rig.world.time)
    rig.run(0.6)
    rig.arm.cancel()
    rig.run(0.3)
    assert execution.status is GoalStatus.CANCELED
    held = rig.world.panda.state().positions
    rig.run(0.7)
    assert rig.world.panda.state().positions == pytest.approx(held, abs=2e-3)


def test_a_block_is_held_and_carried(rig):
    world = rig.world
    block = world.add(block_shape(), PlanarPose(0.5, 0.2, 0.0).as_pose(0.02), "red")
    tcp = world.panda.tcp_in_base()
    pybullet.setGravity(0, 0, 0, physicsClientId=world.client)
    world.move_object(block, Pose(tcp.rotation, tcp.translation))
    grasp = rig.hand.start(GripperGoal(0.0, 20.0), world.time)
    rig.run(3.0, grasp)
    pybullet.setGravity(0, 0, -9.8, physicsClientId=world.client)
    assert grasp.status is GoalStatus.SUCCEEDED
    assert grasp.result.width == pytest.approx(0.04, abs=3e-3)
    motion = rig.arm.start(sweep(np.array([0.8, 0, 0, 0, 0, 0, 0]), 1.5), world.time)
    rig.run(4.0, motion)
    assert motion.status is GoalStatus.SUCCEEDED
    carried = world.object_pose(block).translation - world.panda.tcp_in_base().translation
    assert np.linalg.norm(carried) < 0.01
    release = rig.hand.start(GripperGoal(0.04), world.time)
    rig.run(3.0, release)
    assert release.status is GoalStatus.SUCCEEDED
    rig.run(1.0)
    assert world.object_pose(block).translation[2] < 0.05
