"""Limits of an arm's joints, and the reflexes with which it refuses commands that jump."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from panda_model import ArmModel
from panda_model.limits import SlowEnds, velocity_ratio
from sim_bridge.control.trajectory_spline import Array, TrajectorySpline
from sim_bridge.robot import ROBOT


class JointStates(Protocol):
    """Measured joints in the controller's order: positions (7,) [rad], velocities (7,) [rad/s]."""

    @property
    def positions(self) -> Array:
        """Positions (7,) [rad]."""
        ...

    @property
    def velocities(self) -> Array:
        """Velocities (7,) [rad/s]."""
        ...


@dataclass(frozen=True)
class ArmControllerConfig:
    """Names and limits of the arm, by default the Panda, and tolerances; angles in rad, speeds in rad/s.

    A tolerance of 0 is not checked. The two `..._jump` values are what an arm's reflex allows between what it
    does and what it is told to do next. slow_ends: lower speeds near the ends of the range, for an arm that has such.
    """

    joint_names: tuple[str, ...] = ROBOT.arm_joints
    lower: tuple[float, ...] = tuple(ROBOT.limits.lower.tolist())
    upper: tuple[float, ...] = tuple(ROBOT.limits.upper.tolist())
    velocity: tuple[float, ...] = tuple(ROBOT.limits.velocity.tolist())
    acceleration: tuple[float, ...] = tuple(ROBOT.limits.acceleration.tolist())
    path_tolerance: float = 0.2
    goal_tolerance: float = 0.01
    stopped_velocity: float = 0.05
    position_jump: float = 0.02
    velocity_jump: float = 0.1
    max_brake_s: float = 0.25
    slow_ends: SlowEnds | None = None

    @classmethod
    def for_arm(cls, arm: ArmModel) -> ArmControllerConfig:
        """Return the default tolerances with the names and limits of this arm."""
        limits = arm.limits
        return cls(
            arm.arm_joints,
            tuple(limits.lower.tolist()),
            tuple(limits.upper.tolist()),
            tuple(limits.velocity.tolist()),
            tuple(limits.acceleration.tolist()),
            slow_ends=limits.slow_ends,
        )


@dataclass(frozen=True, eq=False)
class JointCommand:
    """Desired positions (7,) [rad], velocities (7,) [rad/s] and accelerations (7,) [rad/s^2]."""

    positions: Array
    velocities: Array
    accelerations: Array


def reflex_fault(
    spline: TrajectorySpline,
    time: float,
    state: JointStates,
    command: JointCommand,
    config: ArmControllerConfig,
) -> str | None:
    """Return a real arm's objection to following `spline` from `time` [s] on; None where it has none.

    `state` is what the arm does, `command` what it was last told.
    """
    first, velocity, _ = spline.sample(time)
    times, positions, velocities = spline.sweep(0.01)
    jumps = np.abs(np.diff(velocities, axis=0, append=np.zeros((1, first.size))))
    jumps[:-1][np.diff(times) > 0.0] = 0.0  # only where two segments meet, and at the end
    checks = (
        (
            "the first point is {:.3f} rad from {} (limit {:g})",
            np.abs(first - state.positions),
            config.position_jump,
        ),
        (
            "the start jumps by {:.2f} rad/s at {} (limit {:g})",
            np.abs(velocity - command.velocities),
            config.velocity_jump,
        ),
        ("the speed jumps by {:.2f} rad/s at {} (limit {:g})", jumps.max(axis=0), config.velocity_jump),
        (
            "a position is {:.3f} rad beyond the upper limit of {}",
            (positions - config.upper).max(axis=0),
            1e-6,
        ),
        (
            "a position is {:.3f} rad beyond the lower limit of {}",
            (config.lower - positions).max(axis=0),
            1e-6,
        ),
        (
            "the speed is {:.2f} times the limit of {}",
            velocity_ratio(positions, velocities, config.velocity, config.slow_ends).max(axis=0),
            1.01,
        ),
    )
    for text, values, limit in checks:
        joint = int(np.argmax(values))
        if values[joint] > limit:
            return text.format(values[joint], config.joint_names[joint], limit)
    return None


def at_rest(positions: Array) -> JointCommand:
    """Return the command that stays at `positions` (7,) [rad]."""
    zeros = np.zeros(len(positions))
    return JointCommand(np.array(positions, dtype=float), zeros, zeros)
