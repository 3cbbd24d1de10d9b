"""A simulated arm that goes where another arm's joint states say, in place of goals: the other's controllers rule.

So the world around an arm that speaks its own protocol is simulated, while that arm is somebody else's simulation.
"""

from __future__ import annotations

import math
import threading
from dataclasses import dataclass, replace

import numpy as np

from sim_bridge.control.arm_reflex import JointCommand
from sim_bridge.control.gripper_controller import GripperCommand, GripperController
from sim_bridge.control.joint_trajectory_controller import JointTrajectoryController
from sim_bridge.control.trajectory_spline import Array
from sim_bridge.panda import ArmState
from sim_bridge.robot import HAND, ROBOT
from sim_bridge.world import SimWorld

SQUEEZE = 0.004  # by which the fingers are told to be nearer than reported: so they press on what is between them [m]
_FORCE = 20.0  # [N]
_MOST_STEPS = 12  # at once, so that other work on the thread has its turn
_FAR = 0.5  # [s]
_WAIT = 0.001  # until a report is looked for again [s]


@dataclass(frozen=True, eq=False)
class Reported:
    """Joint states of the other arm.

    time [s]; positions (7,) [rad]; velocities (7,) [rad/s]; width: between the fingers [m], None where nothing is said
    of them, and they stay as they are.
    """

    time: float
    positions: Array
    velocities: Array
    width: float | None


class Mirror:
    """Takes reports in any thread; stands in for a loop's pacer: simulated time follows the reports'.

    A world whose time is far behind, as at the start, is put there at once. One whose time is ahead, as after a scene
    that settled, waits.
    """

    def __init__(self, world: SimWorld) -> None:
        self._world, self._lock = world, threading.Lock()
        self._newest: Reported | None = None
        self.arm, self.hand = MirroredArm(self), MirroredHand(self)

    @property
    def newest(self) -> Reported | None:
        """The newest report; None before the first."""
        return self._newest

    def report(self, joints: Reported) -> None:
        """Take note of joint states."""
        with self._lock:
            if self._newest is not None and joints.time <= self._newest.time:
                return
            if joints.width is None:
                known = HAND.opening if self._newest is None else self._newest.width
                joints = replace(joints, width=known)
            self._newest = joints

    def due(self, now: float) -> int:
        """Return the number of steps until the simulation's time is that of the newest report."""
        newest = self._newest
        if newest is None:
            return 0
        behind = newest.time - self._world.time
        if behind > _FAR:
            self._world.skip(behind)
            return 1
        return min(max(math.floor(behind / self._world.dt + 1e-6), 0), _MOST_STEPS)

    def delay(self, now: float) -> float:
        """Return how long to wait before the next look [s]."""
        return _WAIT


class MirroredArm(JointTrajectoryController):
    """Follows the reports; takes no goal."""

    def __init__(self, mirror: Mirror) -> None:
        super().__init__()
        self._mirror = mirror

    def update(self, time: float, state: ArmState) -> JointCommand:  # type: ignore[override]
        """Return what was reported last; the ready pose before."""
        newest = self._mirror.newest
        if newest is None:
            return JointCommand(np.array(ROBOT.ready), np.zeros(7), np.zeros(7))
        return JointCommand(newest.positions, newest.velocities, np.zeros(7))


class MirroredHand(GripperController):
    """Follows the reports; takes no goal."""

    def __init__(self, mirror: Mirror) -> None:
        super().__init__()
        self._mirror = mirror

    def update(self, time: float, state: ArmState) -> GripperCommand:  # type: ignore[override]
        """Return a width a little below the reported one."""
        newest = self._mirror.newest
        width = HAND.opening if newest is None or newest.width is None else newest.width - SQUEEZE
        return GripperCommand(max(width, 0.0), _FORCE)
