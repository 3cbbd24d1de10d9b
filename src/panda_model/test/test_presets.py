"""Presets: what is shipped can be loaded and is whole; what is wrong in a file is named."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

import panda_model
from panda_model import ARM_DOF, PresetError, load_preset, preset_names
from panda_model.description import OWN, load_description
from panda_model.errors import DescriptionError

FOLDER = Path(panda_model.__file__).parent / "presets"


@pytest.fixture
def content() -> dict[str, Any]:
    """A preset as a user would begin it: a copy of the Panda's, its hand written out."""
    values = yaml.safe_load((FOLDER / "panda.yaml").read_text())
    values["hand"] = yaml.safe_load((FOLDER / "hands/franka_hand.yaml").read_text())
    return values


def test_what_is_shipped() -> None:
    assert preset_names() == ["fr3", "panda"]


@pytest.mark.parametrize("name", preset_names())
def test_a_shipped_preset_is_an_arm(name: str) -> None:
    arm = load_preset(name)
    limits = arm.limits
    assert arm.name == name
    assert (limits.lower < limits.upper).all()
    assert all((bound > 0.0).all() for bound in (limits.velocity, limits.acceleration, limits.jerk, arm.torque))
    assert limits.contains(arm.ready)
    named = (*arm.joints, arm.base_frame, arm.flange_frame, arm.hand_frame, arm.tcp_frame)
    assert len(set(named)) == ARM_DOF + 2 + 4
    assert all(n.startswith(arm.prefix) for n in named)
    assert arm.arm_action.startswith("/") and arm.gripper_action.startswith("/")


def test_a_gripper_offers_franka_msgs_where_the_preset_says_so(content: dict[str, Any], tmp_path: Path) -> None:
    arm = load_preset("fr3")
    assert (arm.grasp_action, arm.move_action) == ("/franka_gripper/grasp", "/franka_gripper/move")
    assert (arm.homing_action, arm.gripper_stop) == ("/franka_gripper/homing", "/franka_gripper/stop")
    assert arm.motion_actions == (
        arm.arm_action, arm.gripper_action, arm.grasp_action, arm.move_action, arm.homing_action,
    )  # fmt: skip
    assert arm.with_gripper("") is arm and arm.with_gripper(arm.gripper_action) is arm
    other = arm.with_gripper("/other")
    assert (other.gripper_action, other.franka_gripper) == ("/other", "")
    assert other.motion_actions == (arm.arm_action, "/other")
    del content["franka_gripper"]  # a file from before it was known
    path = tmp_path / "mine.yaml"
    path.write_text(yaml.safe_dump(content))
    assert load_preset(str(path)).franka_gripper == ""


@pytest.mark.parametrize("name", preset_names())
def test_no_array_can_be_changed(name: str) -> None:
    arm = load_preset(name)
    for array in (arm.ready, arm.torque, arm.limits.lower, arm.limits.upper, arm.limits.jerk):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1.0


def test_the_description_has_every_name_of_the_preset_it_was_made_for() -> None:
    arm = load_preset()
    description = load_description(arm)
    for name in (*arm.joints, arm.base_frame, arm.flange_frame, arm.hand_frame, arm.tcp_frame):
        assert f'"{name}"' in description.urdf
    assert description.notice == ""


def test_a_stand_in_says_so() -> None:
    arm = load_preset("fr3")
    assert load_description(arm).notice.startswith("preset fr3 uses the Panda's kinematics (same link lengths)")
    own = load_description(arm).urdf.replace('"panda_', '"fr3_')
    given = load_description(arm, own)
    assert (given.notice, given.prefix) == ("", "fr3_")
    assert "fr3_link5" in given.srdf and "panda_link5" not in given.srdf


def test_meshes_of_a_users_urdf_lie_beside_it(tmp_path: Path) -> None:
    arm = load_preset("fr3")
    own = load_description(arm).urdf.replace('"panda_', '"fr3_')
    path = tmp_path / "mine.urdf"
    path.write_text(own.replace("package://example-robot-data/", "meshes/"))
    meshes = load_description(arm, str(path)).urdf
    assert f'filename="{tmp_path.resolve()}/meshes/' in meshes and 'filename="meshes/' not in meshes
    path.write_text(own)
    assert load_description(arm, str(path)).urdf == own  # what has a scheme, or a whole path, stays


def test_an_arm_without_a_urdf_of_its_own_says_so() -> None:
    with pytest.raises(DescriptionError, match="preset panda names no package with a URDF of its own"):
        load_description(load_preset("panda"), OWN)

    arm = load_preset("fr3")
    other = replace(arm, description=replace(arm.description, own="no-such-package:fr3.urdf"))
    with pytest.raises(DescriptionError, match="'no-such-package', which has the URDF of preset fr3, is not installed"):
        load_description(other, OWN)


def test_a_description_that_does_not_fit_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    panda = load_preset()
    with pytest.raises(DescriptionError, match="no link 'fr3_link0', which preset 'fr3' names"):
        load_description(load_preset("fr3"), load_description(panda).urdf)
    with pytest.raises(DescriptionError, match="cannot read the robot description"):
        load_description(panda, str(tmp_path / "none.urdf"))

    def not_installed(name: str) -> None:
        from importlib.metadata import PackageNotFoundError

        raise PackageNotFoundError(name)

    monkeypatch.setattr("panda_model.description.metadata.distribution", not_installed)
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(tmp_path))
    with pytest.raises(DescriptionError, match="install the package 'example-robot-data'"):
        load_description(panda)


def test_what_follows_from_the_hands_dimensions() -> None:
    hand = load_preset().hand
    assert hand.widest == pytest.approx(hand.opening - 2 * hand.finger_slack)
    assert hand.finger_length == pytest.approx(hand.palm_above_tcp + hand.fingertip_below_tcp)
    assert 0.0 < hand.mount_above_tcp < hand.palm_above_tcp
    assert hand.finger_width == 2 * hand.finger_half_width


def test_the_users_own_file(content: dict[str, Any], tmp_path: Path) -> None:
    content["hand"]["opening"], content["frames"]["base"] = 0.1, "panda_base"
    path = tmp_path / "mine.yaml"
    path.write_text(yaml.safe_dump(content))
    arm = load_preset(str(path))
    assert (arm.name, arm.hand.opening, arm.base_frame) == ("mine", 0.1, "panda_base")
    assert arm.prefix == "panda_"
    np.testing.assert_array_equal(arm.limits.lower, load_preset().limits.lower)


def test_an_unknown_preset_names_the_known() -> None:
    with pytest.raises(PresetError, match="unknown robot 'pr2'; known are fr3, panda"):
        load_preset("pr2")


ENDS = {"lower": [-3.0] * 7, "upper": [3.0] * 7, "slope": [8.0] * 7, "offset": [0.3] * 7}


@pytest.mark.parametrize(
    ("where", "value", "words"),
    [
        ("ready", [0.0] * 6, "ready must be 7 numbers"),
        ("ready", [0.0] * 8, "ready must be 7 numbers"),
        ("limits.velocity", [1.0] * 6 + [float("nan")], "velocity must be 7 numbers"),
        ("limits.jerk", None, "limits: keys missing jerk"),
        ("colour", "white", "keys unknown colour"),
        ("arm_joints", ["a"] * 7, "arm_joints must be 7 different names"),
        ("arm_joints", list("abcdefgg"), "arm_joints must be 7 different names"),
        ("limits.lower", [3.0] * 7, "limits: each of lower must be less than that of upper"),
        ("limits.velocity", [1.0] * 6 + [0.0], "limits: velocity must be positive, got .*0.0"),
        ("limits.jerk", [-1.0] * 7, "limits: jerk must be positive"),
        ("frames", "panda", "frames must be a mapping of base, flange, hand, tcp"),
        ("gripper_reports_full_width", "yes", "must be true or false, got 'yes'"),
        ("gripper_reports_stalled", 1, "must be true or false, got 1"),
        ("limits.slow_ends", [1.0] * 7, "slow_ends must be a mapping of lower, upper, slope, offset"),
        ("limits.slow_ends", {"lower": [0.0] * 7}, "slow_ends: keys missing offset, slope, upper"),
        ("limits.slow_ends", ENDS | {"slope": [0.0] * 7}, "slow_ends: slope must be positive"),
        ("limits.slow_ends", ENDS | {"offset": [-0.1] * 7}, "slow_ends: slope must be positive and offset 0 or more"),
        ("hand", "robotiq", "unknown hand 'robotiq'; known are franka_hand"),
        ("hand.opening", 0.0, "opening must be a positive number, got 0.0"),
        ("hand.opening", -0.08, "opening must be a positive number, got -0.08"),
        ("hand.pad_length", True, "pad_length must be a positive number, got True"),
    ],
)
def test_what_is_wrong_in_a_file_is_named(
    content: dict[str, Any], tmp_path: Path, where: str, value: Any, words: str
) -> None:
    *outer, key = where.split(".")
    inner = content[outer[0]] if outer else content
    inner[key] = value
    if value is None:
        del inner[key]
    path = tmp_path / "mine.yaml"
    path.write_text(yaml.safe_dump(content))
    with pytest.raises(PresetError, match=words) as caught:
        load_preset(str(path))
    assert "\n" not in str(caught.value)


def test_files_that_are_no_presets(tmp_path: Path) -> None:
    with pytest.raises(PresetError, match=r"cannot read the preset .*none\.yaml: No such file"):
        load_preset(str(tmp_path / "none.yaml"))
    for text, words in (("a: [", "is not YAML"), ("- 1", "must hold a mapping")):
        path = tmp_path / f"{len(words)}.yaml"
        path.write_text(text)
        with pytest.raises(PresetError, match=words):
            load_preset(str(path))
