"""The FR3's own URDF, where a package that has it is installed, against the Panda's that stands in for it."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("franky_sim", reason="needs franky-sim: make setup EXTRAS='all driver'")

from panda_executor.model import PandaModel
from panda_model import load_preset
from panda_model.description import OWN, load_description


def test_the_stand_in_has_the_fr3s_kinematics() -> None:
    arm = load_preset("fr3")
    own, stand_in = PandaModel(arm, description=load_description(arm, OWN)), PandaModel(arm)
    rng = np.random.default_rng(0)
    for _ in range(50):
        positions = rng.uniform(arm.limits.lower, arm.limits.upper)
        for mine, its in zip(own.tcp_arrays(positions), stand_in.tcp_arrays(positions)):
            np.testing.assert_allclose(mine, its, atol=1e-9)
    assert not own.in_collision(arm.ready)
    assert len(own.geometry.geometryObjects) == len(stand_in.geometry.geometryObjects)
