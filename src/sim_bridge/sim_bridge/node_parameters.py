"""The node's parameters: declared, checked once, and handed on as values."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, fields
from typing import Any

from rcl_interfaces.msg import ParameterDescriptor
from rclpy.node import Node

from cliport_core import topics
from cliport_perception.calibration.board import Board, parse_board
from cliport_perception.errors import CalibrationError
from panda_model import DEFAULT_PRESET, ArmModel, load_preset
from sim_bridge.control.gripper_controller import HandFault
from sim_bridge.errors import SimBridgeError
from sim_bridge.rendering.sensor_noise import NoiseConfig, SensorKind
from sim_bridge.robot import HAND

FRANKA_EPSILON = 0.005  # of franka_gripper's own for GripperCommand [m]


class ParameterError(SimBridgeError):
    """A parameter has a value that cannot be used; the message carries it and what would do."""


@dataclass(frozen=True)
class SimParameters:
    """Parameters of the node, read at its start. Rates in Hz of simulated time, times in s, widths in m.

    `trajectory_log` is the path of a file that gets a JSON line for each accepted trajectory; empty for none.
    `heartbeat_timeout` is wall time. Time waits for a picture that is due: a machine too slow to draw `camera_rate` of
    them stays below `real_time_factor`. `render_threads` 0 uses every core. `robot` is a preset of panda_model: its
    names and limits; an empty `base_frame`, `arm_action` or `gripper_action` is the preset's. `camera_mounting` is the
    path of a YAML file that says where the camera stands; empty for the shipped one. `camera_kind` is a SensorKind: the
    defaults of what `noise.<name>` sets. `publish_camera_pose`: whether /tf_static says where the camera stands; where
    not, somebody else has to, as with a real one. `hand_fault` is a HandFault: what is wrong with the hand. `mirror`: a
    topic of another arm's joint states; then the simulated arm goes where they say, and time is theirs; it takes no
    goals and publishes neither joint states nor a clock. `held_board`: the form, as in `calibrate --board`, of a
    calibration board that is fixed to the hand; empty for none.
    """

    task: str = "put-blocks-in-bowls-seen-colors"
    split: str = "test"
    seed: int = 0
    instruction: str = ""
    camera_rate: float = 5.0
    joint_state_rate: float = 50.0
    clock_rate: float = 50.0
    real_time_factor: float = 1.0
    heartbeat_timeout: float = 0.2
    franka_quirks: bool = True
    grasp_epsilon_inner: float = FRANKA_EPSILON
    grasp_epsilon_outer: float = FRANKA_EPSILON
    hand_fault: str = HandFault.NONE.value
    trajectory_log: str = ""
    render_threads: int = 0
    robot: str = DEFAULT_PRESET
    base_frame: str = ""
    camera_mounting: str = ""
    camera_kind: str = SensorKind.PLAIN.value
    camera_frame: str = "camera_color_optical_frame"
    publish_camera_pose: bool = True
    held_board: str = ""
    arm_action: str = ""
    gripper_action: str = ""
    heartbeat_topic: str = topics.HEARTBEAT
    mirror: str = ""

    def __post_init__(self) -> None:
        ranges = {
            "camera_rate": (0.1, 60.0),
            "joint_state_rate": (1.0, 240.0),
            "clock_rate": (1.0, 240.0),
            "real_time_factor": (0.01, 100.0),
            "heartbeat_timeout": (0.1, 60.0),
            "grasp_epsilon_inner": (0.0, HAND.opening),
            "grasp_epsilon_outer": (0.0, HAND.opening),
            "seed": (0, 2**62),
            "render_threads": (0, 1024),
        }
        for name in ("base_frame", "arm_action", "gripper_action"):
            object.__setattr__(self, name, getattr(self, name) or getattr(self.arm, name))
        self.fault_of_hand  # noqa: B018  (raises where it names none)
        for name, (least, most) in ranges.items():
            value = getattr(self, name)
            if not least <= value <= most:
                raise ParameterError(f"parameter {name} must be in {least:g}..{most:g}, got {value}")

    @property
    def arm(self) -> ArmModel:
        """The preset of the arm that is stood in for. Raises PresetError when it is unknown."""
        return load_preset(self.robot)

    @property
    def fault_of_hand(self) -> HandFault:
        """The fault of the hand. Raises ParameterError when `hand_fault` names no fault."""
        try:
            return HandFault(self.hand_fault)
        except ValueError:
            known = ", ".join(fault.value for fault in HandFault if fault.value)
            raise ParameterError(f"parameter hand_fault is '{self.hand_fault}'; known are {known}") from None

    @property
    def board(self) -> Board | None:
        """The board that is fixed to the hand. Raises ParameterError when `held_board` describes none."""
        try:
            return parse_board(self.held_board) if self.held_board else None
        except CalibrationError as error:
            raise ParameterError(f"parameter held_board: {error}") from None


def declare_parameters(node: Node) -> tuple[SimParameters, NoiseConfig]:
    """Declare every parameter on `node` and return the values; those of the noise are called `noise.<name>`.

    Raises ParameterError for a value of the wrong kind or out of range.
    """
    parameters = {field.name: _declare(node, field.name, field.default) for field in fields(SimParameters)}
    defaults = asdict(NoiseConfig.of_kind(_kind(parameters["camera_kind"])))
    noise = {name: _declare(node, f"noise.{name}", default) for name, default in defaults.items()}
    for name, value in noise.items():
        if value < 0.0:
            raise ParameterError(f"parameter noise.{name} must be zero or positive, got {value}")
    return SimParameters(**parameters), NoiseConfig(**noise)


def _kind(name: str) -> SensorKind:
    try:
        return SensorKind(name)
    except ValueError:
        known = ", ".join(kind.value for kind in SensorKind)
        raise ParameterError(f"parameter camera_kind is '{name}'; known are {known}") from None


def _declare(node: Node, name: str, default: Any) -> Any:
    """Declare a parameter and return its value, of its default's type; an integer is accepted for a float."""
    descriptor = ParameterDescriptor(dynamic_typing=True, description=f"{type(default).__name__}; set at the start")
    value = node.declare_parameter(name, default, descriptor).value
    if isinstance(default, float) and isinstance(value, int) and not isinstance(value, bool):
        value = float(value)
    if type(value) is not type(default) or (isinstance(value, float) and math.isnan(value)):
        raise ParameterError(
            f"parameter {name} must be of type {type(default).__name__} (such as {default!r}), got {value!r}"
        )
    return value
