"""Kinematics by finite differences; what counts as a collision."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from panda_executor.errors import RobotDescriptionError
from panda_executor.ik import hand_down_pose
from panda_executor.limits import PANDA_LIMITS, READY_POSITIONS
from panda_executor.model import HAND_FRAME, PandaModel, find_description

RANDOM = np.random.default_rng(3)
CONFIGURATIONS = RANDOM.uniform(PANDA_LIMITS.lower, PANDA_LIMITS.upper, (12, 7))


@pytest.mark.parametrize("positions", CONFIGURATIONS)
def test_the_jacobian_is_the_derivative_of_the_pose(model: PandaModel, positions: np.ndarray) -> None:
    jacobian, step = model.tcp_jacobian(positions), 1e-6
    for joint in range(7):
        shift = np.eye(7)[joint] * step
        r0, p0 = model.tcp_arrays(positions - shift)
        r1, p1 = model.tcp_arrays(positions + shift)
        np.testing.assert_allclose((p1 - p0) / (2 * step), jacobian[:3, joint], atol=1e-7)
        np.testing.assert_allclose(pin.log3(r1 @ r0.T) / (2 * step), jacobian[3:, joint], atol=1e-7)


def test_the_error_jacobian_predicts_how_the_error_shrinks(model: PandaModel) -> None:
    target = pin.SE3(*(np.array(a) for a in model.tcp_arrays(CONFIGURATIONS[0])))
    positions = CONFIGURATIONS[0] + 1e-4 * RANDOM.normal(size=7)
    error, jacobian = model.tcp_error_and_jacobian(positions, target)
    np.testing.assert_allclose(jacobian @ (CONFIGURATIONS[0] - positions), error, atol=1e-6)


def test_pose_and_arrays_agree_and_rotations_are_proper(model: PandaModel) -> None:
    for positions in CONFIGURATIONS:
        rotation, translation = model.tcp_arrays(positions)
        pose = model.tcp_pose(positions)
        np.testing.assert_array_equal(pose.rotation, rotation)
        np.testing.assert_array_equal(pose.translation, translation)
        np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-12)
        assert np.linalg.det(rotation) == pytest.approx(1.0)


def test_the_tcp_is_between_the_fingertips(model: PandaModel) -> None:
    for positions in CONFIGURATIONS:
        hand, tcp = model.frame_pose(HAND_FRAME, positions), model.tcp_pose(positions)
        np.testing.assert_allclose((hand.inverse() @ tcp).translation, [0.0, 0.0, 0.1034], atol=1e-9)


def test_the_ready_pose_looks_down_and_is_free(model: PandaModel) -> None:
    pose = model.tcp_pose(READY_POSITIONS)
    np.testing.assert_allclose(pose.rotation[:, 2], [0.0, 0.0, -1.0], atol=2e-3)
    assert 0.25 < pose.translation[0] < 0.4
    assert pose.translation[2] > 0.4
    assert not model.in_collision(READY_POSITIONS)
    assert model.colliding_pair(READY_POSITIONS) is None


def test_a_folded_arm_collides_with_itself(model: PandaModel) -> None:
    folded = np.array([0.0, 0.0, 0.0, -3.05, 0.0, 0.0, 0.0])
    assert model.in_collision(folded)
    assert " and " in (model.colliding_pair(folded) or "")


def test_a_hand_below_the_table_collides_with_it(planner, model: PandaModel) -> None:
    down, _ = planner.ik.refine(hand_down_pose(0.5, 0.0, -0.02, 0.0), READY_POSITIONS)
    assert "table" in (model.colliding_pair(down) or "")


def test_the_camera_post_stands_in_the_way(planner, model: PandaModel) -> None:
    boxes = [model.has_fixed_box(name) for name in ("table", "camera", "camera post", "lamp")]
    assert boxes == [True, True, True, False]
    stretched = np.array([0.0, 0.77, 0.0, -0.6, 0.0, 3.26, 0.785])
    assert "camera" in (model.colliding_pair(stretched) or "")


def test_what_is_missing_is_named(model: PandaModel, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert (find_description() / "srdf" / "panda.srdf").is_file()
    with pytest.raises(RobotDescriptionError, match="no frame 'panda_tail'"):
        model.frame_pose("panda_tail", READY_POSITIONS)
    missing = "panda_executor.model.metadata.distribution"

    def not_installed(name: str) -> None:
        from importlib.metadata import PackageNotFoundError

        raise PackageNotFoundError(name)

    monkeypatch.setattr(missing, not_installed)
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(tmp_path))
    with pytest.raises(RobotDescriptionError, match="install the package 'example-robot-data'"):
        find_description()
