"""What the simulator takes from elsewhere: the arm's preset, and the file that says where the camera stands."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from panda_model import PresetError, load_preset
from sim_bridge.control.arm_reflex import ArmControllerConfig
from sim_bridge.control.gripper_controller import GripperConfig
from sim_bridge.node_parameters import SimParameters
from sim_bridge.rendering.camera import CameraConfig
from sim_bridge.rendering.mounting import MountingError, load_mounting
from sim_bridge.robot import HAND, ROBOT


def test_the_controllers_keep_the_presets_names_and_limits() -> None:
    assert ArmControllerConfig() == ArmControllerConfig.for_arm(ROBOT)
    fr3 = load_preset("fr3")
    config = ArmControllerConfig.for_arm(fr3)
    assert config.joint_names == fr3.arm_joints
    for name in ("lower", "upper", "velocity", "acceleration"):
        np.testing.assert_array_equal(getattr(config, name), getattr(fr3.limits, name))
    assert config.path_tolerance == ArmControllerConfig().path_tolerance
    assert GripperConfig().max_width == HAND.opening


@pytest.mark.parametrize("robot", ["panda", "fr3"])
def test_names_that_are_not_given_are_the_presets(robot: str) -> None:
    arm = load_preset(robot)
    parameters = SimParameters(robot=robot, arm_action="/mine")
    names = (parameters.base_frame, parameters.gripper_action, parameters.arm_action)
    assert names == (arm.base_frame, arm.gripper_action, "/mine")


def test_an_unknown_robot_is_refused() -> None:
    with pytest.raises(PresetError, match="unknown robot 'pr2'"):
        SimParameters(robot="pr2")


def test_the_camera_stands_where_the_file_says(tmp_path: Path) -> None:
    shipped = load_mounting()
    assert CameraConfig().camera_in_base.is_close(shipped)
    file = tmp_path / "mounting.yaml"
    file.write_text("camera: {position: [0.45, 0.8, 0.9], looking_at: [0.45, 0, 0]}")
    moved = load_mounting(str(file))
    np.testing.assert_array_equal(moved.translation, [0.45, 0.8, 0.9])
    ahead = moved.rotation[:, 2]
    np.testing.assert_allclose(moved.translation + ahead * np.hypot(0.8, 0.9), [0.45, 0.0, 0.0], atol=1e-12)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("camera: [", "is not YAML"),
        ("lens: {}", "must hold 'camera' with 'position' and 'looking_at'"),
        ("camera: {position: [1, 2], looking_at: [0, 0, 0]}", r"position must be three numbers, .* got \[1, 2\]"),
        ("camera: {position: [1, 2, .nan], looking_at: [0, 0, 0]}", "position must be three numbers"),
        ("camera: {position: [1, 0, 1], looking_at: [1, 0, 1]}", "looks at where it stands"),
    ],
)
def test_a_mounting_that_says_nothing_is_refused(tmp_path: Path, text: str, words: str) -> None:
    file = tmp_path / "mounting.yaml"
    file.write_text(text)
    with pytest.raises(MountingError, match=words) as caught:
        load_mounting(str(file))
    assert "\n" not in str(caught.value)
    with pytest.raises(MountingError, match=r"cannot read .*none\.yaml"):
        load_mounting(str(tmp_path / "none.yaml"))
