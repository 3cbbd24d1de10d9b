"""Sampling between points, by finite differences; malformed trajectories."""

from __future__ import annotations

import numpy as np
import pytest

from panda_executor.errors import TrajectoryError
from panda_executor.trajectory import JointTrajectory
from panda_model import load_preset

PANDA_LIMITS = load_preset().limits
FR3_LIMITS = load_preset("fr3").limits


@pytest.fixture
def trajectory() -> JointTrajectory:
    random = np.random.default_rng(0)
    times = np.concatenate([[0.0], np.cumsum(random.uniform(0.05, 0.3, 6))])
    return JointTrajectory(load_preset().arm_joints, times, *(random.normal(size=(7, 7)) for _ in range(3)))


def test_the_points_are_on_the_curve(trajectory: JointTrajectory) -> None:
    position, velocity, acceleration, _ = trajectory.sample(trajectory.times)
    np.testing.assert_allclose(position, trajectory.positions, atol=1e-12)
    np.testing.assert_allclose(velocity, trajectory.velocities, atol=1e-9)
    np.testing.assert_allclose(acceleration, trajectory.accelerations, atol=1e-8)


def test_samples_are_each_others_derivatives(trajectory: JointTrajectory) -> None:
    inner = np.linspace(0.01, trajectory.duration - 0.01, 57)
    inner = inner[np.abs(inner[:, None] - trajectory.times).min(axis=1) > 1e-4]
    step = 1e-5
    before, here, after = (trajectory.sample(inner + d) for d in (-step, 0.0, step))
    for order in range(3):
        slope = (after[order] - before[order]) / (2 * step)
        np.testing.assert_allclose(slope, here[order + 1], rtol=1e-4, atol=1e-3)


def test_outside_its_times_it_rests_at_its_ends(trajectory: JointTrajectory) -> None:
    position, *_ = trajectory.sample(np.array([-1.0, 99.0]))
    np.testing.assert_allclose(position, [trajectory.start, trajectory.end], atol=1e-12)


@pytest.mark.parametrize(("points", "joints"), [(1, 7), (3, 6)])
def test_too_small_ones_are_refused(points: int, joints: int) -> None:
    rows = np.zeros((points, joints))
    with pytest.raises(TrajectoryError, match="two points or more of 7 joints"):
        JointTrajectory(load_preset().arm_joints[:joints], np.arange(float(points)), rows, rows, rows)


def test_unequal_shapes_are_refused() -> None:
    rows = np.zeros((3, 7))
    with pytest.raises(TrajectoryError, match=r"velocities have shape \(2, 7\), expected \(3, 7\)"):
        JointTrajectory(load_preset().arm_joints, np.arange(3.0), rows, rows[:2], rows)


@pytest.mark.parametrize("limits", [PANDA_LIMITS, FR3_LIMITS])
def test_limits_scale_and_shrink(limits) -> None:
    scaled = limits.scaled(0.5, 0.25, 0.1)
    np.testing.assert_allclose(scaled.velocity, limits.velocity * 0.5)
    np.testing.assert_allclose(scaled.acceleration, limits.acceleration * 0.25)
    np.testing.assert_allclose(scaled.jerk, limits.jerk * 0.1)
    middle = (limits.lower + limits.upper) / 2.0
    assert limits.contains(middle)
    assert not limits.shrunk(0.1).contains(limits.lower + 0.05)
    assert not limits.contains(np.full(7, np.nan))
    with pytest.raises(ValueError, match="jerk scaling"):
        limits.scaled(1.0, 1.0, 0.0)
    with pytest.raises(ValueError, match="read-only"):
        limits.lower[0] = 0.0
