"""The simulator's arm and the executor's model are the same arm."""

from collections.abc import Iterator

import numpy as np
import pybullet
import pytest

from panda_executor.model import PandaModel
from panda_model import load_preset
from sim_bridge.panda import PandaArm

PANDA_LIMITS = load_preset().limits


@pytest.fixture
def client() -> Iterator[int]:
    number = pybullet.connect(pybullet.DIRECT)
    yield number
    pybullet.disconnect(number)


def test_tcp_poses_agree_to_a_tenth_of_a_millimetre(client: int) -> None:
    arm = PandaArm(client)
    model = PandaModel()
    rng = np.random.default_rng(0)
    for _ in range(200):
        positions = rng.uniform(PANDA_LIMITS.lower, PANDA_LIMITS.upper)
        for i, position in enumerate(positions, start=1):
            pybullet.resetJointState(arm.body, arm.link_indices[f"panda_link{i}"], position, physicsClientId=client)
        simulated, modelled = arm.tcp_in_base(), model.tcp_pose(positions)
        assert np.linalg.norm(simulated.translation - modelled.translation) < 1e-4
        turn = simulated.rotation.T @ modelled.rotation
        assert np.arccos(np.clip((np.trace(turn) - 1) / 2, -1, 1)) < 1e-3
