"""Boxes beside the arm, the distances that are kept to them, and descriptions that do not fit, in words."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from panda_executor.errors import RobotDescriptionError
from panda_executor.model import PandaModel, _finger_joints
from panda_model import FloatArray, load_preset
from panda_model.description import load_description

ARM = load_preset()
SIZE, CENTRE = np.array([0.2, 0.3, 0.4]), np.array([0.5, -0.1, 1.2])


@pytest.fixture(scope="module")
def own() -> PandaModel:
    """A model with two lamps, of which one was put twice."""
    model = PandaModel(ARM, 0.05)
    links = (model.link("link7"), model.link("hand"))
    model.put_fixed_box("lamp", np.ones(3), np.zeros(3), links, 0.0)
    model.put_fixed_box("other lamp", SIZE, -CENTRE, links[:1], 0.0)
    model.put_fixed_box("lamp", SIZE, CENTRE, links, 0.03)
    return model


def boxes(model: PandaModel) -> list[pin.GeometryObject]:
    return [item for item in model.geometry.geometryObjects if item.parentJoint == 0 and "lamp" in item.name]


def test_a_box_stands_where_it_was_put_last_with_its_clearance(own: PandaModel) -> None:
    lamp, other = boxes(own)
    for item, centre, clearance in ((lamp, CENTRE, 0.03), (other, -CENTRE, 0.0)):
        np.testing.assert_allclose(item.placement.translation, centre)
        np.testing.assert_array_equal(item.placement.rotation, np.eye(3))
        np.testing.assert_allclose(item.geometry.halfSide, SIZE / 2.0 + clearance)
    for name, centre, clearance in (("lamp", CENTRE, 0.03), ("other lamp", -CENTRE, 0.0)):
        found, half = own.fixed_boxes[name]
        np.testing.assert_allclose(found, centre)
        np.testing.assert_allclose(half, SIZE / 2.0 + clearance)
    assert own.has_fixed_box("other lamp") and not own.has_fixed_box("third lamp")


def test_a_box_is_compared_with_the_named_links_alone_and_without_more_distance(own: PandaModel) -> None:
    objects, margins = own.geometry.geometryObjects, dict[str, float]()
    against: dict[str, set[str]] = {}
    for pair, request in zip(own.geometry.collisionPairs, own._geometry_data.collisionRequests, strict=True):
        first, second = objects[pair.first], objects[pair.second]
        if "lamp" in second.name:
            against.setdefault(second.name, set()).add(own.model.frames[first.parentFrame].name)
            assert request.security_margin == 0.0
        else:
            margins[f"{first.name} {second.name}"] = request.security_margin
    links = {own.link("link7"), own.link("hand")}
    assert list(against.values()) == [links, {own.link("link7")}]
    assert len(margins) > 10 and set(margins.values()) == {0.05}


def nearest(model: PandaModel, positions: FloatArray) -> float:
    """Return the distance between the links that are compared [m]."""
    geometry = model.geometry.copy()
    data = pin.GeometryData(geometry)
    pin.computeDistances(model.model, model.data, geometry, data, positions)
    return float(min(result.min_distance for result in data.distanceResults))


def test_links_keep_their_distance_of_each_other() -> None:
    """The arm folds until it is 3 cm from itself: there, and no earlier, the usual model says so."""
    usual, bare = PandaModel(), PandaModel(self_clearance=0.0)
    said = []
    for fold in np.linspace(-2.0, -3.05, 60):
        positions = np.array([0.0, 0.0, 0.0, fold, 0.0, 1.6, 0.785])
        distance = nearest(usual, positions)
        if abs(distance - 0.03) > 1e-4 and abs(distance) > 1e-4:
            said.append(usual.in_collision(positions))
            assert said[-1] is (distance < 0.03)
            assert bare.in_collision(positions) is (distance < 0.0)
    assert 2 < sum(said) < len(said) - 2


def test_a_collision_is_told_by_the_names_of_link_and_box(own: PandaModel) -> None:
    hand = own.tcp_pose(ARM.ready)
    own.put_fixed_box("lamp", np.full(3, 0.02), hand.translation + np.array([0.0, 0.0, 0.09]), (own.link("hand"),), 0.0)
    try:
        assert own.colliding_pair(ARM.ready) == "panda_hand and lamp"
    finally:
        own.put_fixed_box("lamp", SIZE, CENTRE, (own.link("hand"),), 0.03)
    assert own.colliding_pair(ARM.ready) is None


def test_the_fingers_stand_open(own: PandaModel) -> None:
    """Each is half of the opening from the hand's middle."""
    for name, side in (("leftfinger", 1.0), ("rightfinger", -1.0)):
        hand, finger = own.frame_pose(ARM.hand_frame, ARM.ready), own.frame_pose(own.link(name), ARM.ready)
        assert (hand.inverse() @ finger).translation[1] == pytest.approx(side * ARM.hand.opening / 2.0)


def test_names_of_the_preset_become_those_of_the_description() -> None:
    fr3 = PandaModel(load_preset("fr3"))
    assert fr3.named("fr3_hand") == fr3.link("hand") == "panda_hand"
    assert fr3.named("my_tool") == "my_tool"


def chain(joints: list[pin.JointModel], beside: int = 2) -> pin.Model:
    """Return joints one after the other with the frame "tcp" behind the last, and some beside them on the base."""
    model, last = pin.Model(), 0
    for number, joint in enumerate(joints):
        last = model.addJoint(last, joint, pin.SE3.Identity(), f"arm{number}")
    for number in range(beside):
        model.addJoint(0, pin.JointModelPZ(), pin.SE3.Identity(), f"finger{number}")
    model.addFrame(pin.Frame("tcp", last, 0, pin.SE3.Identity(), pin.FrameType.OP_FRAME))
    return model


def test_fingers_are_the_two_joints_beside_the_arms() -> None:
    seven = [pin.JointModelRZ() for _ in range(7)]
    model = chain(seven)
    assert [model.names[joint] for joint in _finger_joints(model, "tcp")] == ["finger0", "finger1"]


@pytest.mark.parametrize(
    ("joints", "beside", "words"),
    [
        (6, 2, "the robot description has 6 joints from its base to 'tcp', expected 7 of one angle each: "
               "arm0, arm1, arm2, arm3, arm4, arm5"),
        (8, 2, "the robot description has 8 joints from its base to 'tcp', expected 7 of one angle each: "
               "arm0, arm1, arm2, arm3, arm4, arm5, arm6, arm7"),
        (0, 2, "the robot description has 0 joints from its base to 'tcp', expected 7 of one angle each: none"),
        (7, 0, "the robot description has these joints beside the arm's, not two fingers: none"),
        (7, 1, "the robot description has these joints beside the arm's, not two fingers: finger0"),
        (7, 3, "the robot description has these joints beside the arm's, not two fingers: finger0, finger1, finger2"),
    ],
)  # fmt: skip
def test_another_number_of_joints_is_told_with_their_names(joints: int, beside: int, words: str) -> None:
    with pytest.raises(RobotDescriptionError) as caught:
        _finger_joints(chain([pin.JointModelRZ() for _ in range(joints)], beside), "tcp")
    assert str(caught.value) == words


@pytest.mark.parametrize("number", range(7))
def test_a_joint_without_an_end_is_not_one_of_the_arms(number: int) -> None:
    joints = [pin.JointModelRUBZ() if i == number else pin.JointModelRZ() for i in range(7)]
    with pytest.raises(RobotDescriptionError, match="expected 7 of one angle each"):
        _finger_joints(chain(joints), "tcp")


def test_a_missing_tcp_frame_is_named() -> None:
    with pytest.raises(RobotDescriptionError, match=r"^the robot description has no frame 'tip'$"):
        _finger_joints(chain([pin.JointModelRZ() for _ in range(7)]), "tip")
    broken = replace(load_description(ARM), urdf="<robot name='x'>")
    with pytest.raises(RobotDescriptionError, match="the robot description cannot be used"):
        PandaModel(ARM, description=broken)
