from __future__ import annotations

import itertools

import numpy as np

from panda_executor.model import PandaModel
from panda_executor.motions import _joined
from panda_executor.timing import time_path
from panda_model import load_preset

ARM = load_preset()


def test_legs_follow_one_another_with_a_stop_at_each_corner(model: PandaModel) -> None:
    corners = [ARM.ready, ARM.ready + 0.2, ARM.ready - 0.1]
    legs = [time_path(np.stack(pair), ARM.limits, model, 1.0) for pair in itertools.pairwise(corners)]
    joined = _joined(legs)
    assert len(joined.times) == len(legs[0].times) + len(legs[1].times) - 1
    assert (np.diff(joined.times) > 0.0).all()
    assert joined.duration == legs[0].duration + legs[1].duration
    at = len(legs[0].times) - 1
    np.testing.assert_allclose(joined.positions[[0, at, -1]], corners, atol=1e-9)
    np.testing.assert_allclose(joined.velocities[at], 0.0, atol=1e-9)
    for name in ("positions", "velocities", "accelerations"):
        np.testing.assert_array_equal(getattr(joined, name)[at + 1 :], getattr(legs[1], name)[1:])
        np.testing.assert_array_equal(getattr(joined, name)[: at + 1], getattr(legs[0], name))
