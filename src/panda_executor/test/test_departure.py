"""Motions begun where the arm was measured: the same end, smooth, within limits."""

from __future__ import annotations

import numpy as np
import pytest

from panda_executor.departure import depart_from
from panda_executor.errors import TrajectoryError
from panda_executor.model import PandaModel
from panda_executor.timing import time_path
from panda_executor.trajectory import JointTrajectory
from panda_model import load_preset

PANDA = load_preset()
LIMITS = PANDA.limits.scaled(0.5, 0.5, 0.2)
OFFSET = np.array([0.05, -0.03, 0.0, 0.02, 0.06, -0.05, 0.01])


@pytest.fixture(params=[0.002, 0.4])
def planned(model: PandaModel, request: pytest.FixtureRequest) -> JointTrajectory:
    """A short motion, and a long one."""
    way = np.linspace(0.0, request.param, 5)[:, None] * np.array([1.0, -0.5, 0.3, 0.4, 0.0, 0.6, -1.0])
    return time_path(PANDA.ready + way, LIMITS, model, 1.0)


def test_it_begins_here_and_ends_there_within_limits(planned: JointTrajectory) -> None:
    here = planned.start + OFFSET
    begun = depart_from(planned, here, LIMITS, 0.08)
    np.testing.assert_allclose(begun.start, here, atol=1e-12)
    np.testing.assert_allclose(begun.end, planned.end, atol=1e-12)
    times = np.arange(0.0, begun.duration, 1e-3)
    _, velocity, acceleration, jerk = begun.sample(times)
    for values, bound in (
        (velocity, LIMITS.velocity), (acceleration, LIMITS.acceleration), (jerk, LIMITS.jerk)
    ):  # fmt: skip
        assert (np.abs(values).max(axis=0) <= 1.01 * bound).all()
    assert not begun.velocities[[0, -1]].any()


def test_points_are_on_the_sum_of_both_curves(planned: JointTrajectory) -> None:
    """Between the points, too: the controller's interpolation loses nothing."""
    begun = depart_from(planned, planned.start + OFFSET, PANDA.limits.scaled(1.0, 1.0, 1.0), 0.08)
    share = np.linspace(0.0, 1.0, 401)
    left = 1.0 - share**3 * (10.0 - 15.0 * share + 6.0 * share**2)
    wanted = planned.sample(share * planned.duration)[0] + left[:, None] * OFFSET
    np.testing.assert_allclose(begun.sample(share * begun.duration)[0], wanted, atol=1e-9)


def test_an_arm_that_is_there_changes_nothing(planned: JointTrajectory) -> None:
    assert depart_from(planned, planned.start, LIMITS, 0.08) is planned


@pytest.mark.parametrize("away", [0.09, np.nan])
def test_an_arm_that_is_elsewhere_is_refused(planned: JointTrajectory, away: float) -> None:
    here = planned.start.copy()
    here[4] += away
    with pytest.raises(TrajectoryError, match=r"away from where the motion begins \(at most 0\.08\); observe again"):
        depart_from(planned, here, LIMITS, 0.08)
