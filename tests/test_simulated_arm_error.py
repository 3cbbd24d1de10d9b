"""`calibrate --simulate` has the gripper off by at least as much as joints do whose noise moves the tip by 0.3 mm."""

from __future__ import annotations

import math

import numpy as np
from scipy.spatial.transform import Rotation

from cliport_perception.calibration.simulation import SimulationConfig
from panda_executor.model import PandaModel

JOINT_NOISE = 1e-3  # [rad]
TIP_ERROR = 0.0003  # length of the tip's error that joint noise makes, root mean square [m]
BENT = np.array([0.0, -0.3, 0.0, -2.1, 0.0, 1.9, 0.785])


def over_the_workspace(model: PandaModel, rng: np.random.Generator, count: int) -> list[np.ndarray]:
    """Postures (7,) [rad] with the tip where a board is carried."""
    found: list[np.ndarray] = []
    while len(found) < count:
        joints = BENT + rng.uniform(-0.5, 0.5, 7)
        x, y, z = model.tcp_arrays(joints)[1]
        if 0.35 < x < 0.65 and abs(y) < 0.3 and 0.2 < z < 0.6:
            found.append(joints)
    return found


def test_the_grippers_error_is_no_less_than_the_joints() -> None:
    model, rng = PandaModel(), np.random.default_rng(0)
    shifts, turns = [], []
    for joints in over_the_workspace(model, rng, 400):
        rotation, tip = model.tcp_arrays(joints)
        noisy, off = model.tcp_arrays(joints + rng.normal(0.0, JOINT_NOISE, 7))
        shifts.append(off - tip)
        turns.append(Rotation.from_matrix(rotation.T @ noisy).as_rotvec())
    shift, turn = (math.sqrt(np.mean(np.square(values))) for values in (shifts, turns))  # per axis
    print(f"1 mrad of each joint: {1e3 * shift:.2f} mm and {1e3 * turn:.2f} mrad per axis")
    per_axis, config = TIP_ERROR / math.sqrt(3.0), SimulationConfig()
    assert config.arm_shift >= per_axis
    assert config.arm_turn >= per_axis * turn / shift
