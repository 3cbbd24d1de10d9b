"""The last look's bounds on limits, from either side, and the configurations between which it looks."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from panda_executor import validation
from panda_executor.errors import TrajectoryError
from panda_executor.trajectory import JointTrajectory
from panda_executor.validation import dense_positions, validate_trajectory
from panda_model import FloatArray, JointLimits, load_preset

PANDA = load_preset()
NAMES = PANDA.arm_joints


class Everything:
    """A scene whose tcp moves two metres for a radian of the second joint, and which keeps what it was asked."""

    def __init__(self) -> None:
        self.model = SimpleNamespace(tcp_arrays=lambda q: (np.eye(3), np.array([0.0, 2.0 * q[1], 0.1 * q[6]])))
        self.looked_at: list[FloatArray] = []
        self.wall = np.inf

    def is_valid(self, positions: FloatArray) -> bool:
        self.looked_at.append(positions)
        return float(positions[0]) < self.wall

    def problem(self, positions: FloatArray) -> str:
        return f"a wall at {positions[0]:.2f}"


def swing(joint: int, by: float, seconds: float) -> JointTrajectory:
    """One joint, from rest to rest in one quintic."""
    ends = np.zeros((2, 7)) + PANDA.ready
    ends[1, joint] += by
    still = np.zeros((2, 7))
    return JointTrajectory(NAMES, np.array([0.0, seconds]), ends, still, still)


def peaks(joint: int, trajectory: JointTrajectory) -> dict[str, float]:
    _, *derivatives = trajectory.sample(np.arange(0.0, trajectory.duration + 1e-9, 1e-3))
    found = (float(np.abs(d[:, joint]).max()) for d in derivatives)
    return dict(zip(("velocity", "acceleration", "jerk"), found, strict=True))


def looked(trajectory: JointTrajectory, limits: JointLimits = PANDA.limits) -> list[FloatArray]:
    scene: Any = Everything()
    validate_trajectory(trajectory, limits, scene)
    return scene.looked_at


@pytest.mark.parametrize("name", ["velocity", "acceleration", "jerk"])
@pytest.mark.parametrize("joint", [0, 3, 6])
@pytest.mark.parametrize("by", [-0.4, 0.4])
def test_two_per_cent_over_a_limit_pass_and_three_do_not(name: str, joint: int, by: float) -> None:
    trajectory = swing(joint, by, 1.0)
    bounds = np.full(7, 1e4)
    wide = replace(PANDA.limits, velocity=bounds, acceleration=bounds, jerk=bounds)
    for share, passes in ((1.019, True), (1.021, False)):
        tight = bounds.copy()
        tight[joint] = peaks(joint, trajectory)[name] / share
        limits: Any = replace(wide, **{name: tight})  # type: ignore[arg-type]
        if passes:
            looked(trajectory, limits)
        else:
            words = rf"^{NAMES[joint]} would reach 1\.02 times its {name} limit$"
            with pytest.raises(TrajectoryError, match=words):
                looked(trajectory, limits)


@pytest.mark.parametrize("joint", [1, 5])
@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_the_joint_that_passes_a_limit_most_is_named(joint: int, side: float) -> None:
    trajectory = swing(0, 0.01, 5.0)
    positions = trajectory.positions.copy()
    bound = PANDA.limits.upper if side > 0.0 else PANDA.limits.lower
    positions[:, 2] = PANDA.limits.upper[2] + 0.01
    positions[:, joint] = bound[joint] + side * 0.03
    with pytest.raises(TrajectoryError, match=rf"^{NAMES[joint]} would pass its position limit by 0\.030 rad$"):
        looked(replace(trajectory, positions=positions))


def test_a_position_limit_may_be_passed_by_a_millionth() -> None:
    trajectory = swing(0, 0.01, 5.0)
    for beyond, passes in ((5e-7, True), (2e-6, False)):
        positions = trajectory.positions.copy()
        positions[:, 4] = PANDA.limits.lower[4] - beyond
        if passes:
            looked(replace(trajectory, positions=positions))
        else:
            with pytest.raises(TrajectoryError, match="position limit"):
                looked(replace(trajectory, positions=positions))


@pytest.mark.parametrize(("shift", "passes"), [(0.0, True), (0.3, True), (-1e-3, False)])
def test_a_trajectory_begins_at_zero_or_later(shift: float, passes: bool) -> None:
    trajectory = swing(0, 0.1, 2.0)
    late = replace(trajectory, times=trajectory.times + shift)
    if passes:
        looked(late)
    else:
        with pytest.raises(TrajectoryError, match="do not strictly increase from zero"):
            looked(late)


@pytest.mark.parametrize("row", [0, -1])
@pytest.mark.parametrize("speed", [1e-9, -1e-9])
def test_no_end_moves_at_all(row: int, speed: float) -> None:
    trajectory = swing(0, 0.1, 2.0)
    velocities = trajectory.velocities.copy()
    velocities[row, 3] = speed
    with pytest.raises(TrajectoryError, match="velocity is not zero"):
        looked(replace(trajectory, velocities=velocities))


def test_the_controller_is_followed_every_millisecond_and_at_each_point() -> None:
    times = validation._controller_times(np.array([0.5, 0.50025, 0.5035]))
    np.testing.assert_allclose(times, [0.5, 0.50025, 0.501, 0.502, 0.503, 0.5035], atol=1e-12)


def test_collisions_are_looked_for_all_the_way_and_at_both_ends() -> None:
    trajectory = swing(0, 0.5, 1.0)
    found = np.array(looked(trajectory))
    np.testing.assert_allclose(found[[0, -1]], trajectory.positions, atol=1e-12)
    assert len(found) == 26 and np.diff(found[:, 0]) == pytest.approx(0.02, rel=0.05)
    scene: Any = Everything()
    scene.wall = PANDA.ready[0] + 0.49
    with pytest.raises(TrajectoryError, match=r"^on the way a wall at 0\.50$"):
        validate_trajectory(trajectory, PANDA.limits, scene)


@pytest.mark.parametrize(
    ("way", "shares"),
    [
        ([[0.0, 0.0], [0.1, 0.0]], np.linspace(0.0, 1.0, 6)),
        ([[0.0, 0.0], [-0.05, 0.0]], np.linspace(0.0, 1.0, 4)),
        ([[0.0, 0.0], [0.0, 0.02]], np.linspace(0.0, 1.0, 5)),
        ([[0.3, 0.1], [0.3, 0.1]], [0.0, 0.0]),
        ([[0.0, 0.0], [0.001, 0.0]], [0.0, 1.0]),
    ],
)
def test_steps_are_as_long_as_the_joints_or_the_tcp_allow(way: list[list[float]], shares: Any) -> None:
    """0.02 rad of a joint, or 1 cm of the tcp, which goes four times as far for the second joint here."""
    rough = np.zeros((2, 7))
    rough[:, :2] = way
    scene: Any = Everything()
    expected = rough[0] + np.asarray(shares)[:, None] * (rough[1] - rough[0])
    np.testing.assert_allclose(dense_positions(rough, scene), expected, atol=1e-12)


def test_legs_are_divided_by_their_own_lengths() -> None:
    rough = np.zeros((3, 7))
    rough[1, 0], rough[2, :2] = 0.04, (0.04, 0.01)  # two steps of a joint, then two of the tcp
    scene: Any = Everything()
    found = dense_positions(rough, scene)
    np.testing.assert_allclose(found[:, 0], [0.0, 0.02, 0.04, 0.04, 0.04], atol=1e-12)
    np.testing.assert_allclose(found[:, 1], [0.0, 0.0, 0.0, 0.005, 0.01], atol=1e-12)
