"""Faults that tests switch on while the node runs, as ROS parameters."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from rcl_interfaces.msg import ParameterDescriptor, SetParametersResult
from rclpy.node import Node
from rclpy.parameter import Parameter
from scipy.spatial.transform import Rotation

from cliport_core import Pose
from sim_bridge.control.joint_trajectory_controller import TrajectoryExecution
from sim_bridge.sim_loop import SimLoop

ABORT_AFTER_S = 0.3
_DESCRIPTIONS = {
    "freeze_camera": "true: the camera publishes nothing",
    "depth_all_nan": "true: the depth image has no valid pixel",
    "abort_next_trajectory": "true: the next trajectory is aborted on its way; then false again",
}
_BUMP, _AT_REST = "bump_camera", [0.0] * 6
_BUMP_TEXT = "how the camera was moved, in the base frame: x, y, z [m], rotation vector [rad]; nobody is told"


class FaultInjection:
    """The switches `freeze_camera`, `depth_all_nan` and `abort_next_trajectory`, and the camera's `bump_camera`."""

    def __init__(self, node: Node, loop: SimLoop) -> None:
        self._node = node
        self._loop = loop
        self._on: dict[str, bool] = {}
        self._victim: tuple[TrajectoryExecution, float] | None = None
        for name, text in _DESCRIPTIONS.items():
            value = node.declare_parameter(name, False, ParameterDescriptor(description=text)).value
            self._on[name] = bool(value)
        bump = node.declare_parameter(_BUMP, _AT_REST, ParameterDescriptor(description=_BUMP_TEXT)).value
        self._bump = _bump(bump)
        node.add_on_set_parameters_callback(self._set)
        loop.every(0.02, self._tick)

    @property
    def camera_frozen(self) -> bool:
        """True if the camera publishes nothing."""
        return self._on["freeze_camera"]

    @property
    def depth_lost(self) -> bool:
        """True if the depth image has no valid pixel."""
        return self._on["depth_all_nan"]

    def true_pose(self, camera_in_base: Pose) -> Pose:
        """Return where the camera is that should be at `camera_in_base`: it is turned about itself, and shifted."""
        bump = self._bump
        return Pose(bump.rotation @ camera_in_base.rotation, bump.translation + camera_in_base.translation)

    def started(self, execution: TrajectoryExecution, time: float) -> None:
        """Note that a trajectory begins at simulated `time` [s]; it is the victim if one was asked for."""
        if self._on["abort_next_trajectory"]:
            self._victim = (execution, time + ABORT_AFTER_S)
            self._node.set_parameters([Parameter("abort_next_trajectory", value=False)])

    def _set(self, parameters: list[Parameter]) -> SetParametersResult:
        for parameter in parameters:
            if parameter.name in self._on:
                self._on[parameter.name] = bool(parameter.value)
            elif parameter.name == _BUMP:
                try:
                    self._bump = _bump(parameter.value)
                except ValueError as error:
                    return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def _tick(self, time: float, state: Any) -> None:
        if self._victim is not None and time >= self._victim[1]:
            execution, _ = self._victim
            self._victim = None
            if not execution.done:
                self._loop.arm.hold("the controller aborted the motion (injected fault)")


def _bump(numbers: Sequence[float]) -> Pose:
    """Return the shift and the turn of six numbers. Raises ValueError when they are something else."""
    if len(numbers) != len(_AT_REST) or not all(math.isfinite(number) for number in numbers):
        raise ValueError(f"{_BUMP} must be six finite numbers, got {list(numbers)}")
    return Pose(Rotation.from_rotvec(numbers[3:]).as_matrix(), np.asarray(numbers[:3], dtype=np.float64))
