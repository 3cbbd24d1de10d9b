"""The arm and the hand behind libfranka, by franky. Nothing else in the project imports it."""

from __future__ import annotations

import time as clock
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy as np

from panda_driver.errors import ArmFaultError, ConnectionFailedError, DriverError, HandFaultError
from panda_driver.ports import ArmState, HandState
from panda_model.limits import FloatArray

_INSTALL = "franky is not installed: run 'make setup EXTRAS=\"all driver\"'"
CLEARED_S = 1.0  # after a recovery, for the states to say that the errors are gone, wall clock
_STOPPED = {  # by the robot's mode: why it does not move
    "UserStopped": "the user stop is pressed: release it, then call ~/recover_errors",
    "Guiding": "the arm is being guided by hand: let go of its buttons",
    "Reflex": "the arm stopped by reflex: look what it touched, then call ~/recover_errors",
    "AutomaticErrorRecovery": "the arm is recovering from an error: wait",
}


@dataclass(frozen=True)
class ArmSettings:
    """Settings of the arm, made before it is controlled.

    torque_threshold [N m], force_threshold [N]: above these a contact stops the arm; load_mass [kg] and load_center [m,
    in the flange's frame] of what is mounted beside the hand known to the arm, taken for a small body; stiffness (7,)
    [N m/rad] of the joints towards their reference, whose damping is critical; realtime: whether a real-time kernel is
    asked for.
    """

    torque_threshold: float = 40.0
    force_threshold: float = 40.0
    load_mass: float = 0.0
    load_center: tuple[float, ...] = (0.0, 0.0, 0.0)
    stiffness: tuple[float, ...] = (600.0, 600.0, 600.0, 600.0, 250.0, 150.0, 50.0)
    realtime: bool = True


def load_franky() -> Any:
    """Return the module franky. Raises DriverError where it is not installed."""
    try:
        import franky
    except ImportError as error:
        raise DriverError(f"{_INSTALL} ({error})") from None
    return franky


def franky_errors(franky: Any) -> tuple[type[Exception], ...]:
    """Return what franky raises: its own errors, and what a connection that breaks throws through it."""
    return franky.Exception, RuntimeError


class FrankyArm:
    """ArmPort of a Franka arm.

    Raises:
        ConnectionFailedError: when it cannot be reached, speaks another version, or a real-time kernel is missing.
    """

    def __init__(self, address: str, settings: ArmSettings) -> None:
        """Connect, and set thresholds and load."""
        self._franky, self._settings = load_franky(), settings
        self._errors = franky_errors(self._franky)
        self._tracker: Any = None
        self._state: Any = None  # the newest that was read, in franky's form
        config = self._franky.RealtimeConfig
        try:
            realtime = config.Enforce if settings.realtime else config.Ignore
            self._robot = self._franky.Robot(address, realtime_config=realtime)
            self._robot.set_collision_behavior(settings.torque_threshold, settings.force_threshold)
            if settings.load_mass > 0.0:
                inertia = (np.eye(3) * 1e-4 * settings.load_mass).ravel().tolist()
                self._robot.set_load(settings.load_mass, list(settings.load_center), inertia)
        except self._errors as error:
            raise ConnectionFailedError(words_of("arm", address, error)) from None
        self._address = address

    def read(self) -> ArmState:
        """Return the newest state."""
        try:
            state = self._state = self._robot.state
        except self._errors as error:
            raise ConnectionFailedError(lost_words("arm", self._address, error)) from None
        fault = _STOPPED.get(state.robot_mode.name, "")
        if fault:
            errors = error_names(state.last_motion_errors) or error_names(state.current_errors)
            fault += f" ({', '.join(errors)})" if errors else ""
        return ArmState(float(state.time.to_sec()), np.array(state.q), np.array(state.dq), np.array(state.tau_J), fault)

    def begin(self) -> None:
        """Take control by torques that pull the joints to their references."""
        with suppress(*self._errors):
            self._robot.poll_motion()  # throws away how an earlier motion ended
        try:
            self._tracker = self._franky.JointImpedanceTracker(
                self._robot, stiffness=np.array(self._settings.stiffness)
            )
        except self._errors as error:
            raise ArmFaultError(reflex_words(error)) from None

    def follow(self, positions: FloatArray, velocities: FloatArray, accelerations: FloatArray) -> None:
        """Set the references, with the torques that the arm's own model takes for the acceleration."""
        if not self._tracker.is_running:
            try:
                self._robot.poll_motion()
            except self._errors as error:
                raise ArmFaultError(reflex_words(error)) from None
            raise ArmFaultError("the arm ended its control without a word: call ~/recover_errors")
        torques = self._robot.model.mass(self._state) @ accelerations
        self._tracker.set_target(positions, dq=velocities, tau_ff=torques)

    def end(self) -> None:
        """Let the torques run out; the arm's own controller holds it then."""
        tracker, self._tracker = self._tracker, None
        if tracker is not None and tracker.is_running:
            self._robot.move(self._franky.TorqueStopMotion(), asynchronous=True)

    def recover(self) -> None:
        """Clear the errors."""
        self._tracker = None
        try:
            done = self._robot.recover_from_errors()
        except self._errors as error:
            raise ArmFaultError(f"the errors stay: {_line(error)}") from None
        deadline = clock.monotonic() + CLEARED_S
        while not done and clock.monotonic() < deadline:  # franky looks at a state that may be of before
            clock.sleep(0.01)
            done = not self.read().fault
        if not done:
            raise ArmFaultError("the arm keeps its errors: look at the lights at its base, and in Desk")

    def close(self) -> None:
        """Come to rest."""
        self.end()
        with suppress(*self._errors):  # it has stopped, if for another reason
            self._robot.join_motion(2.0)


class FrankyHand:
    """HandPort of a Franka Hand. Raises ConnectionFailedError when there is none."""

    def __init__(self, address: str) -> None:
        """Connect."""
        self._franky, self._address = load_franky(), address
        self._errors = franky_errors(self._franky)
        try:
            self._gripper = self._franky.Gripper(address)
        except self._errors as error:
            raise ConnectionFailedError(words_of("hand", address, error)) from None

    def read(self) -> HandState:
        """Return the newest state."""
        try:
            state = self._gripper.state
        except self._errors as error:
            raise ConnectionFailedError(lost_words("hand", self._address, error)) from None
        return HandState(float(state.width), float(state.max_width))

    def move(self, width: float, speed: float) -> FrankyHandMotion:
        """Begin to move."""
        return FrankyHandMotion(self._franky, self._gripper.move_async(width, speed))

    def grasp(self, width: float, speed: float, force: float, epsilon: tuple[float, float] | None) -> FrankyHandMotion:
        """Begin to grasp; without an epsilon with one as wide as the hand."""
        inner, outer = epsilon or 2 * (max(self.read().max_width, width),)
        return FrankyHandMotion(self._franky, self._gripper.grasp_async(width, speed, force, inner, outer))

    def home(self) -> FrankyHandMotion:
        """Begin the homing."""
        return FrankyHandMotion(self._franky, self._gripper.homing_async())

    def stop(self) -> None:
        """Stop the fingers."""
        try:
            self._gripper.stop()
        except self._errors as error:
            raise HandFaultError(f"the hand does not stop: {_line(error)}") from None


class FrankyHandMotion:
    """HandMotion over one of franky's futures."""

    def __init__(self, franky: Any, future: Any) -> None:
        self._errors, self._future = franky_errors(franky), future

    def wait(self, timeout: float) -> bool:
        """Wait at most `timeout` [s]."""
        return bool(self._future.wait(timeout))

    def succeeded(self) -> bool:
        """Return the hand's answer."""
        try:
            return bool(self._future.get())
        except self._errors as error:
            raise HandFaultError(f"the hand failed: {_line(error)}") from None


def words_of(what: str, address: str, error: Exception) -> str:
    """Return one line for a failed connection to the arm or the hand."""
    kind, text = type(error).__name__, _line(error)
    if kind == "IncompatibleVersionException":
        return (
            f"the {what} at {address} speaks another version of the protocol ({text}): this libfranka is for an FR3 of "
            "system version 5.7 or later; an older Panda needs its own driver"
        )
    if kind == "RealtimeException":
        return f"{text}: start a real-time kernel, or give -p realtime:=false, where a simulator is driven"
    if kind == "NetworkException" and what == "hand":
        return f"no hand at {address} ({text}): initialise it in Desk, or give -p gripper:=false"
    if kind == "NetworkException":
        return f"no arm at {address} ({text}): look at the address, the cable, and that FCI is active in Desk"
    return f"the {what} at {address}: {text}"


def lost_words(what: str, address: str, error: Exception) -> str:
    """Return one line for a connection that broke."""
    remedy = "call ~/home_gripper" if what == "hand" else "start the driver again"
    return f"the {what} at {address} was lost ({_line(error)}): look at the cable and in Desk, then {remedy}"


def reflex_words(error: Exception) -> str:
    """Return one line for a motion that the arm ended, or whose states stopped coming."""
    if type(error).__name__ == "NetworkException":
        return f"the arm's states stopped coming ({_line(error)}): look at the cable, then call ~/recover_errors"
    return f"the arm stopped by itself: {_line(error)}; look what it touched, then call ~/recover_errors"


def error_names(errors: Any) -> Sequence[str]:
    """Return the names of the errors that are set in libfranka's list of them."""
    return [name for name in dir(errors) if not name.startswith("_") and getattr(errors, name) is True]


def _line(error: Exception) -> str:
    return " ".join(str(error).split()).removeprefix("libfranka: ").rstrip(".")
