"""Whatever the path, its times keep every limit."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from panda_executor.config import ExecutorConfig
from panda_executor.errors import TrajectoryError
from panda_executor.model import PandaModel
from panda_executor.motions import _rounded
from panda_executor.timing import time_path
from panda_model import JointLimits, load_preset

PANDA_LIMITS = load_preset().limits

FULL = PANDA_LIMITS
USUAL = ExecutorConfig().motion_limits(PANDA_LIMITS)
_TOLERANCE = 1.005  # the validation before sending allows 1.02


def random_path(random: np.random.Generator) -> np.ndarray:
    """Return a path of 2 to 12 points: long and short steps, sharp corners, points that repeat."""
    inner = PANDA_LIMITS.shrunk(0.4)
    count = int(random.integers(2, 13))
    scale = float(random.choice([0.02, 0.1, 0.5]))
    start = random.uniform(inner.lower, inner.upper)
    steps = random.normal(0.0, scale, (count - 1, 7)) * random.integers(0, 2, (count - 1, 7))
    steps[-1, 0] += 0.01
    return np.clip(start + np.concatenate([np.zeros((1, 7)), np.cumsum(steps, axis=0)]), inner.lower, inner.upper)


@pytest.mark.parametrize("limits", [FULL, USUAL], ids=["full", "usual"])
@pytest.mark.parametrize("first_seed", [0, 40, 80])
def test_random_paths_keep_velocity_acceleration_and_jerk(
    model: PandaModel, limits: JointLimits, first_seed: int
) -> None:
    for seed in range(first_seed, first_seed + 40):
        path = random_path(np.random.default_rng(seed))
        if seed % 2 and len(path) > 2:
            path = _rounded(path)  # as the planner does with what the search found
        trajectory = time_path(path, limits, model, tcp_speed=1.0)
        assert trajectory.times[0] == 0.0
        assert np.all(np.diff(trajectory.times) > 0.0)
        assert not trajectory.velocities[[0, -1]].any()
        np.testing.assert_allclose(trajectory.positions[[0, -1]], path[[0, -1]], atol=1e-9)
        _, velocity, acceleration, jerk = trajectory.sample(np.linspace(0.0, trajectory.duration, 600))
        for values, bound in (
            (velocity, limits.velocity),
            (acceleration, limits.acceleration),
            (jerk, limits.jerk),
        ):
            assert np.max(np.abs(values) / bound) <= _TOLERANCE, f"seed {seed}"


def test_the_tcp_keeps_its_speed(model: PandaModel) -> None:
    random = np.random.default_rng(5)
    for speed in (0.1, 0.25):
        path = np.stack([np.array([0.0, -0.6, 0.0, -2.2, 0.0, 1.6, 0.8]), random.uniform(0.1, 0.3, 7)])
        path[1] += path[0]
        trajectory = time_path(path, FULL, model, tcp_speed=speed)
        times = np.linspace(0.0, trajectory.duration, 400)
        tcp = np.array([model.tcp_arrays(q)[1] for q in trajectory.sample(times)[0]])
        fastest = (np.linalg.norm(np.diff(tcp, axis=0), axis=1) / np.diff(times)).max()
        assert 0.5 * speed < fastest < 1.05 * speed


def test_a_straight_path_stays_straight(model: PandaModel) -> None:
    start, end = np.zeros(7) + 0.1, np.linspace(0.2, 0.8, 7)
    trajectory = time_path(np.stack([start, end]), USUAL, model, tcp_speed=1.0)
    position, *_ = trajectory.sample(np.linspace(0.0, trajectory.duration, 200))
    share = (position - start) @ (end - start) / np.sum((end - start) ** 2)
    np.testing.assert_allclose(position, start + share[:, None] * (end - start), atol=1e-9)
    assert np.all(np.diff(share) > -1e-9)


def test_slower_limits_take_longer(model: PandaModel) -> None:
    path = random_path(np.random.default_rng(2))
    assert time_path(path, USUAL, model, 1.0).duration > time_path(path, FULL, model, 1.0).duration


@pytest.mark.parametrize("points", [2, 5])
def test_a_path_without_motion_is_refused(model: PandaModel, points: int) -> None:
    with pytest.raises(TrajectoryError, match="does not move"):
        time_path(np.zeros((points, 7)) + 0.1, USUAL, model, 1.0)


def test_waypoints_that_repeat_make_no_difference(model: PandaModel) -> None:
    path = np.cumsum(np.random.default_rng(1).uniform(0.02, 0.1, (5, 7)), axis=0)
    once = time_path(path, USUAL, model, 1.0)
    twice = time_path(np.repeat(path, 2, axis=0), USUAL, model, 1.0)
    np.testing.assert_allclose(once.positions, twice.positions)
    np.testing.assert_allclose(once.times, twice.times)


def fr3_speed_share(positions: np.ndarray, velocities: np.ndarray) -> float:
    """Greatest share of the speeds that Franka's documentation of the FR3 gives for joint 4, upwards."""
    upwards = np.minimum(2.62, np.maximum(0.0, -0.3 + np.sqrt(np.maximum(0.0, 8.0 * (-0.1458 - positions[:, 3])))))
    return float((np.maximum(velocities[:, 3], 0.0) / np.maximum(upwards, 1e-9)).max())


def test_a_motion_slows_down_towards_the_end_of_an_fr3s_range(model: PandaModel) -> None:
    limits = load_preset("fr3").limits
    path = np.stack([load_preset("fr3").ready] * 2)
    path[1, 3] = -0.22
    shares, durations = [], []
    for each in (limits, replace(limits, slow_ends=None)):
        trajectory = time_path(path, each, model, tcp_speed=10.0)
        positions, velocities, _, _ = trajectory.sample(np.linspace(0.0, trajectory.duration, 2000))
        shares.append(fr3_speed_share(positions, velocities))
        durations.append(trajectory.duration)
    assert shares[0] <= _TOLERANCE < shares[1]
    assert durations[0] > durations[1]


def test_a_path_to_the_very_end_of_an_fr3s_range_is_refused(model: PandaModel) -> None:
    path = np.stack([load_preset("fr3").ready] * 2)
    path[1, 3] = -0.152
    with pytest.raises(TrajectoryError, match="so near the end of a joint's range"):
        time_path(path, load_preset("fr3").limits, model, tcp_speed=10.0)
