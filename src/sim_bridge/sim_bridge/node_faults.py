"""Faults that tests switch on while the node runs, as ROS parameters."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, cast

import numpy as np
from rcl_interfaces.msg import ParameterDescriptor, SetParametersResult
from rclpy.node import Node
from rclpy.parameter import Parameter
from scipy.spatial.transform import Rotation

from cliport_core import Pose
from sim_bridge.control.gripper_controller import GripperGoal
from sim_bridge.control.joint_trajectory_controller import TrajectoryExecution
from sim_bridge.control.trajectory_goal import JointTolerance, TrajectoryGoal
from sim_bridge.errors import SimBridgeError
from sim_bridge.joint_state_faults import JointStateFaults, StateFault
from sim_bridge.robot import HAND
from sim_bridge.sim_loop import SimLoop
from sim_bridge.world import SimWorld

ABORT_AFTER_S = 0.3
STALL_S = 2.0  # until a hand that does not move says so
TIGHT = 1e-7  # a goal's tolerance that no arm keeps [rad]
LATE_S = 0.2
ASIDE_M = 0.15  # of an object that slips away from the closing fingers
CLOCK_JUMP_S = 10.0
_DESCRIPTIONS = {
    "freeze_camera": "true: the camera publishes nothing",
    "depth_all_nan": "true: the depth image has no valid pixel",
    "abort_next_trajectory": "true: the next trajectory is aborted on its way; then false again",
    **{f"joint_states_{fault.value}": f"true: {fault.words}" for fault in StateFault},
    "never_accept": "true: trajectories are not answered",
    "never_end": "true: a trajectory's end is not told",
    "lose_cancel": "true: cancels are confirmed, and nothing comes of them",
    "miss_goal": "true: the arm ends outside of the goal's tolerance",
    "gripper_stalls": "true: the fingers do not move",
    "gripper_misses": "true: what the fingers close on slips away",
    "gripper_drops": "true: the fingers open at once",
    "clock_ahead": f"true: the clock is {CLOCK_JUMP_S:g} s ahead",
    "clock_back": f"true: the clock is {CLOCK_JUMP_S:g} s behind",
}
_BUMP, _AT_REST = "bump_camera", [0.0] * 6
_BUMP_TEXT = "how the camera was moved, in the base frame: x, y, z [m], rotation vector [rad]; nobody is told"


class FaultInjection:
    """The switches, each of whose descriptions says what it does, and the camera's `bump_camera`."""

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
        self.states = JointStateFaults(lambda fault: self._on[f"joint_states_{fault.value}"])
        node.add_on_set_parameters_callback(self._set)
        loop.every(0.02, self._tick)

    def is_on(self, name: str) -> bool:
        """Return True while the switch `name` is on."""
        return self._on[name]

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

    @property
    def clock_shift(self) -> float:
        """Offset of the clock [s]."""
        return CLOCK_JUMP_S * (self._on["clock_ahead"] - self._on["clock_back"])

    def adapted(self, goal: TrajectoryGoal) -> TrajectoryGoal:
        """Return the trajectory as the controller is to take it."""
        if not self._on["miss_goal"]:
            return goal
        tight = {name: JointTolerance(TIGHT) for name in goal.joint_names}
        return replace(goal, goal_tolerance=tight, goal_time_tolerance=LATE_S)

    def started(self, execution: TrajectoryExecution, time: float) -> None:
        """Note that a trajectory begins at simulated `time` [s]; it is the victim if one was asked for."""
        if self._on["abort_next_trajectory"]:
            self._victim = (execution, time + ABORT_AFTER_S)
            self._node.set_parameters([Parameter("abort_next_trajectory", value=False)])

    def closing(self, goal: GripperGoal) -> None:
        """Note that the hand begins to move: what it would close on slips away where that was asked for."""
        world = cast(SimWorld, self._loop.world)
        if not self._on["gripper_misses"] or 2.0 * goal.position > HAND.opening / 2.0:
            return
        tcp = world.panda.tcp_in_base().translation
        loose = [thing for thing in world.objects if not thing.fixed]
        nearest = min(loose, key=lambda thing: float(abs(world.object_pose(thing).translation - tcp).sum()))
        pose = world.object_pose(nearest)
        away = pose.translation.copy()
        away[1] += ASIDE_M if away[1] < 0.0 else -ASIDE_M
        world.move_object(nearest, replace(pose, translation=away))

    def _set(self, parameters: list[Parameter]) -> SetParametersResult:
        for parameter in parameters:
            if parameter.name in self._on:
                self._on[parameter.name] = bool(parameter.value)
            elif parameter.name == _BUMP:
                try:
                    self._bump = _bump(parameter.value)
                except SimBridgeError as error:
                    return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def _tick(self, time: float, state: Any) -> None:
        if self._victim is not None and time >= self._victim[1]:
            execution, _ = self._victim
            self._victim = None
            if not execution.done:
                self._loop.arm.hold("the controller aborted the motion (injected fault)")
        self._loop.gripper.jammed_for = STALL_S if self._on["gripper_stalls"] else None
        if self._on["gripper_drops"]:
            self._on["gripper_drops"] = False
            self._loop.gripper.start(GripperGoal(HAND.opening / 2.0), time)


def _bump(numbers: Sequence[float]) -> Pose:
    """Return the shift and the turn of six numbers. Raises SimBridgeError when they are something else."""
    if len(numbers) != len(_AT_REST) or not all(math.isfinite(number) for number in numbers):
        raise SimBridgeError(f"{_BUMP} must be six finite numbers, got {list(numbers)}")
    return Pose(Rotation.from_rotvec(numbers[3:]).as_matrix(), np.asarray(numbers[:3], dtype=np.float64))
