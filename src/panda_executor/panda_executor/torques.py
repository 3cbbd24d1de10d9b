"""The torques that a motion needs, by inverse dynamics."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from panda_executor.model import PandaModel
from panda_executor.trajectory import JointTrajectory
from panda_model import FloatArray

TORQUE_RATE = 1000.0  # of each joint, above which a Franka arm stops [N m/s]; libfranka's rate limiting
_STEP = 0.002  # between two samples [s]


def torques_of(model: PandaModel, trajectory: JointTrajectory, gravity: bool = False) -> tuple[FloatArray, FloatArray]:
    """Return times (N,) [s] and torques (N, 7) [N m] of the links' own masses along a trajectory.

    gravity: with what the arm's own controller adds to hold it; a driver by torques commands what remains.
    """
    times = np.linspace(0.0, trajectory.duration, max(round(trajectory.duration / _STEP), 2))
    positions, velocities, accelerations, _ = trajectory.sample(times)
    held = model.model.gravity.linear.copy()
    if not gravity:
        model.model.gravity.linear = np.zeros(3)
    try:
        rows = [pin.rnea(model.model, model.data, *row) for row in zip(positions, velocities, accelerations)]
    finally:
        model.model.gravity.linear = held
    return times, np.array(rows)


def torque_shares(model: PandaModel, trajectory: JointTrajectory) -> tuple[float, float]:
    """Return the greatest torque and the greatest rate of torque as shares of what the arm allows."""
    _, whole = torques_of(model, trajectory, gravity=True)
    times, commanded = torques_of(model, trajectory)
    rates = np.abs(np.diff(commanded, axis=0)) / np.diff(times)[:, None]
    return float((np.abs(whole) / model.arm.torque).max()), float(rates.max() / TORQUE_RATE)
