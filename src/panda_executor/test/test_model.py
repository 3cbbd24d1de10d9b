"""Kinematics by finite differences; what counts as a collision."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from synthetic_clouds import CAMERA

from panda_executor.errors import RobotDescriptionError
from panda_executor.ik import hand_down_pose
from panda_executor.model import PandaModel
from panda_executor.transfer import TransferPlanner
from panda_model import load_preset
from panda_model.description import load_description

READY_POSITIONS = load_preset().ready
PANDA_LIMITS = load_preset().limits

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
        hand, tcp = model.frame_pose(model.arm.hand_frame, positions), model.tcp_pose(positions)
        np.testing.assert_allclose(
            (hand.inverse() @ tcp).translation, [0.0, 0.0, model.arm.hand.tcp_from_hand], atol=1e-9
        )


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


def test_a_camera_that_is_placed_elsewhere_is_no_longer_in_the_way() -> None:
    planner = TransferPlanner(PandaModel())
    stretched = np.array([0.0, 0.77, 0.0, -0.6, 0.0, 3.26, 0.785])
    assert planner.model.colliding_pair(stretched) is None, "nobody has said where the camera is"
    planner.place_cameras(CAMERA)
    assert "camera" in (planner.model.colliding_pair(stretched) or "")
    boxes = len(planner.model.geometry.geometryObjects)
    planner.place_cameras(np.array([0.0, 1.2, 0.87]))
    assert planner.model.colliding_pair(stretched) is None
    planner.place_cameras(CAMERA)
    assert "camera" in (planner.model.colliding_pair(stretched) or "")
    assert len(planner.model.geometry.geometryObjects) == boxes


def test_the_camera_post_reaches_from_the_table_to_the_camera(planner, model: PandaModel) -> None:
    (post,) = (box for box in model.geometry.geometryObjects if "camera post" in box.name)
    clearance = planner.config.scene.fixed_clearance  # with which the box was made
    assert float(post.placement.translation[2]) == pytest.approx(float(CAMERA[2]) / 2.0)
    assert float(post.geometry.halfSide[2]) == pytest.approx(float(CAMERA[2]) / 2.0 + clearance)


def test_an_unknown_frame_is_named(model: PandaModel) -> None:
    with pytest.raises(RobotDescriptionError, match="no frame 'panda_tail'"):
        model.frame_pose("panda_tail", READY_POSITIONS)


def test_the_fr3_stands_where_the_panda_does_but_keeps_its_own_names_and_limits(model: PandaModel) -> None:
    fr3 = PandaModel(load_preset("fr3"))
    for positions in CONFIGURATIONS:
        np.testing.assert_array_equal(fr3.tcp_pose(positions).translation, model.tcp_pose(positions).translation)
    assert not fr3.in_collision(fr3.arm.ready)
    assert fr3.frame_pose("fr3_hand", fr3.arm.ready).is_close(model.frame_pose("panda_hand", fr3.arm.ready))
    assert fr3.limits.upper[5] == 4.5169


def test_the_users_own_description_is_what_the_model_moves(tmp_path: Path) -> None:
    arm = load_preset("fr3")
    shipped = load_description(arm)
    longer = shipped.urdf.replace('"panda_', '"fr3_').replace('xyz="0 0 0.333"', 'xyz="0 0 0.4"')
    longer = longer.replace("package://", f"{shipped.package_folders[0]}/")
    assert longer.count('xyz="0 0 0.4"') == 1
    path = tmp_path / "mine.urdf"
    path.write_text(longer)
    for given in (longer, str(path)):
        own = PandaModel(arm, description=load_description(arm, given))
        rise = own.tcp_pose(arm.ready).translation - PandaModel(arm).tcp_pose(arm.ready).translation
        np.testing.assert_allclose(rise, [0.0, 0.0, 0.067], atol=1e-9)
        planner = TransferPlanner(own)
        assert not own.in_collision(arm.ready)
        down, _ = planner.ik.refine(hand_down_pose(0.5, 0.0, -0.02, 0.0), arm.ready)
        assert "table" in (own.colliding_pair(down) or "")


def test_a_drivers_own_names_leave_the_model_as_it_is(model: PandaModel) -> None:
    arm = replace(load_preset("fr3"), base_frame="world", finger_joints=("left", "right"))
    own = PandaModel(arm)
    assert own.tcp_pose(arm.ready).is_close(model.tcp_pose(arm.ready))
    assert own.frame_pose("fr3_hand", arm.ready).is_close(model.frame_pose("panda_hand", arm.ready))
    assert not own.in_collision(arm.ready)
    urdf = load_description(load_preset()).urdf
    assert load_description(replace(load_preset(), base_frame="world"), urdf).prefix == "panda_"


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('type="prismatic"', 'type="fixed"', "these joints beside the arm's, not two fingers: none"),
        ('name="panda_joint3" type="revolute"', 'name="panda_joint3" type="fixed"', "has 6 joints from its base"),
        (
            'name="panda_joint3" type="revolute"',
            'name="panda_joint3" type="continuous"',
            "expected 7 of one angle each",
        ),
    ],
)
def test_a_description_of_another_arm_ends_in_words(old: str, new: str, words: str) -> None:
    arm = load_preset()
    shipped = load_description(arm)
    assert old in shipped.urdf
    with pytest.raises(RobotDescriptionError, match=words) as caught:
        PandaModel(arm, description=replace(shipped, urdf=shipped.urdf.replace(old, new)))
    assert "\n" not in str(caught.value)


def test_a_description_that_is_no_arm_ends_in_words() -> None:
    arm = load_preset()
    no_joints = "<robot name='x'>" + "".join(
        f'<link name="{name}"/>' for name in (arm.base_frame, arm.hand_frame, arm.tcp_frame)
    )
    with pytest.raises(RobotDescriptionError, match="the robot description cannot be used") as caught:
        PandaModel(arm, description=load_description(arm, no_joints + "</robot"))
    assert "\n" not in str(caught.value)
