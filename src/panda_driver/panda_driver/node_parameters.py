"""The driver node's ROS parameters, read once."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from panda_driver.errors import DriverError
from panda_driver.franky_ports import ArmSettings
from panda_model import ARM_DOF, ArmModel, load_preset

if TYPE_CHECKING:
    from rclpy.node import Node

_DEFAULT_ARM = "fr3"  # libfranka of this version speaks to nothing older


@dataclass(frozen=True)
class DriverParameters:
    """Values of the node's parameters.

    address: of the arm; with_hand: whether a hand is driven; connect_timeout [s]: for the arm or the hand to answer;
    heartbeat_timeout [s]: of the executor's, wall clock; joint_state_rate [Hz]: at most; publish_clock: whether the
    arm's own time is the graph's, for a simulator of it.
    """

    robot: ArmModel
    address: str
    settings: ArmSettings
    with_hand: bool
    connect_timeout: float
    heartbeat_timeout: float
    joint_state_rate: float
    publish_clock: bool


def read_parameters(node: Node) -> DriverParameters:
    """Declare and read every parameter.

    Raises:
        DriverError: on a value that cannot be used, with the value.
        CoreError: on an unknown arm.
    """

    def get(name: str, default: Any) -> Any:
        return node.declare_parameter(name, default).value

    def number(name: str, default: float, least: float, most: float) -> float:
        value = float(get(name, default))
        if not least <= value <= most:
            raise DriverError(f"{name} must be in {least:g}..{most:g}, got {value:g}")
        return value

    def numbers(name: str, default: tuple[float, ...], least: float) -> tuple[float, ...]:
        values = tuple(float(value) for value in get(name, list(default)))
        if len(values) != len(default) or not all(least <= value < math.inf for value in values):
            raise DriverError(f"{name} must be {len(default)} numbers, got {list(values)}")
        return values

    robot = load_preset(str(get("arm", _DEFAULT_ARM)))
    address = str(get("robot_ip", ""))
    if not address:
        raise DriverError("robot_ip is empty: give the arm's address, -p robot_ip:=172.16.0.2 for example")
    standard = ArmSettings()
    assert len(standard.stiffness) == ARM_DOF
    settings = ArmSettings(
        torque_threshold=number("torque_threshold", standard.torque_threshold, 1.0, 100.0),
        force_threshold=number("force_threshold", standard.force_threshold, 1.0, 100.0),
        load_mass=number("load_mass", standard.load_mass, 0.0, 3.0),
        load_center=numbers("load_center", standard.load_center, -math.inf),
        stiffness=numbers("stiffness", standard.stiffness, 1.0),
        realtime=bool(get("realtime", standard.realtime)),
    )
    return DriverParameters(
        robot,
        address,
        settings,
        bool(get("gripper", True)),
        number("connect_timeout", 10.0, 1.0, 120.0),
        number("heartbeat_timeout", 0.2, 0.1, 60.0),
        number("joint_state_rate", 200.0, 1.0, 1000.0),
        bool(get("publish_clock", False)),
    )
