"""The ROS parameters by which every node learns what arm it works with."""

from __future__ import annotations

from typing import TYPE_CHECKING

from panda_model.arm import ArmModel
from panda_model.preset_files import DEFAULT_PRESET, load_preset

if TYPE_CHECKING:
    from rclpy.node import Node


def declare_robot(node: Node) -> ArmModel:
    """Declare `robot`, a preset's name or the path of its file, and return that preset.

    Raises:
        PresetError: when there is none of that name, or the file describes no arm.
    """
    return load_preset(str(node.declare_parameter("robot", DEFAULT_PRESET).value))


def declare_base_frame(node: Node, arm: ArmModel) -> str:
    """Declare `base_frame` and return it; where it is empty, the arm's own."""
    return str(node.declare_parameter("base_frame", "").value) or arm.base_frame
