"""The trajectory controller on an arm that follows with a lag, and goals for it."""

from dataclasses import dataclass, field, replace

import numpy as np

from sim_bridge.control import ArmControllerConfig, JointTrajectoryController, TrajectoryGoal, TrajectoryPoint

CONFIG = ArmControllerConfig()
NAMES = CONFIG.joint_names
HOME = np.array([0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785])
DT = 1.0 / 240.0


@dataclass
class FakeArm:
    """Moves a share of the way to its command each step; `stuck` joints do not move."""

    positions: np.ndarray = field(default_factory=lambda: HOME.copy())
    velocities: np.ndarray = field(default_factory=lambda: np.zeros(7))
    stuck: bool = False

    def step(self, command):
        target = self.positions if self.stuck else command.positions
        following = self.positions + 0.5 * (target - self.positions)
        self.velocities = (following - self.positions) / DT
        self.positions = following


@dataclass
class Bench:
    controller: JointTrajectoryController = field(default_factory=JointTrajectoryController)
    arm: FakeArm = field(default_factory=FakeArm)
    time: float = 0.0
    commands: list = field(default_factory=list)

    def run(self, seconds, execution=None):
        for _ in range(round(seconds / DT)):
            command = self.controller.update(self.time, self.arm)
            self.commands.append(command)
            self.arm.step(command)
            self.time += DT
            if execution is not None and execution.done:
                break

    def start(self, goal):
        return self.controller.start(goal, self.time)


def swing(angle=0.5, seconds=1.5, **changes):
    """Joint 1 by `angle`, smoothly, from rest to rest."""
    end = HOME.copy()
    end[0] += angle
    middle, speed = (HOME + end) / 2.0, np.zeros(7)
    speed[0] = 1.875 * angle / seconds  # of a quintic from rest to rest
    goal = TrajectoryGoal.from_arrays(
        NAMES,
        [0.0, seconds / 2.0, seconds],
        [HOME, middle, end],
        [np.zeros(7), speed, np.zeros(7)],
        np.zeros((3, 7)),
    )
    return replace(goal, **changes)


def point(time, positions=HOME, velocities=(), accelerations=()):
    return TrajectoryPoint(time, tuple(positions), tuple(velocities), tuple(accelerations))


def far(joint, value):
    positions = HOME.copy()
    positions[joint] = value
    return positions
