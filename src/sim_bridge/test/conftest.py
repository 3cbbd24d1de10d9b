"""Moves the hand without planner or controllers, for tests of the physics: straight joint interpolation."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from sim_bridge.bullet import pybullet
from sim_bridge.world import SimWorld

LOWER = [-2.8973, -1.7628, -2.8973, -3.0718, -2.8973, -0.0175, -2.8973]
UPPER = [2.8973, 1.7628, 2.8973, -0.0698, 2.8973, 3.7525, 2.8973]


class ScriptedHand:
    """Hand pointing down; `yaw` turns it about z."""

    def __init__(self, world: SimWorld) -> None:
        self.world = world
        self._target = world.panda.state().positions

    def go(self, x: float, y: float, z: float, yaw: float, seconds: float = 1.0) -> None:
        """Move the TCP there and wait until it arrived."""
        end = self._solve(np.array([x, y, z]), yaw)
        start, steps = self._target, round(seconds * self.world.config.rate_hz)
        for i in range(1, steps + 1):
            u = i / steps
            share, rate = 10 * u**3 - 15 * u**4 + 6 * u**5, (30 * u**2 - 60 * u**3 + 30 * u**4) / seconds
            self.world.panda.command(start + share * (end - start), rate * (end - start))
            self.world.step()
        self._target = end

    def fingers(self, width: float, effort: float = 20.0, seconds: float = 0.8) -> float:
        """Open or close; the width that came of it [m]."""
        self.world.panda.command_fingers(width, effort)
        for _ in range(round(seconds * self.world.config.rate_hz)):
            self.world.step()
        return self.world.panda.state().width

    def _solve(self, position: np.ndarray, yaw: float) -> np.ndarray:
        panda = self.world.panda
        # the hand's frame is 0.1034 m above the TCP, z down
        quaternion = pybullet.getQuaternionFromEuler([math.pi, 0.0, yaw])
        link = panda.link_indices["panda_hand"]
        saved = panda.state()
        joints = self._target
        for _ in range(30):
            for i, q in enumerate(joints):
                pybullet.resetJointState(panda.body, i, q, physicsClientId=self.world.client)
            joints = np.array(
                pybullet.calculateInverseKinematics(
                    panda.body,
                    link,
                    (position + np.array([0.0, 0.0, 0.1034])).tolist(),
                    quaternion,
                    lowerLimits=LOWER,
                    upperLimits=UPPER,
                    jointRanges=[5.0] * 7,
                    restPoses=self._target.tolist(),
                    physicsClientId=self.world.client,
                )[:7]
            )
        for i, (q, v) in enumerate(zip(saved.positions, saved.velocities, strict=True)):
            pybullet.resetJointState(panda.body, i, q, v, physicsClientId=self.world.client)
        for i, q in zip((9, 10), saved.finger_positions, strict=True):
            pybullet.resetJointState(panda.body, i, q, physicsClientId=self.world.client)
        return joints


@pytest.fixture
def scripted_hand() -> Callable[[SimWorld], ScriptedHand]:
    """Makes hands for worlds."""
    return ScriptedHand
