"""The arm and the hand as the driver needs them: franky serves these, and tests hand in their own."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from panda_model.limits import FloatArray


@dataclass(frozen=True, eq=False)
class ArmState:
    """One measurement: the arm's own time [s], positions [rad], velocities [rad/s] and efforts [N m], each (7,).

    fault: why the arm does not move, in words; empty while it may.
    """

    time: float
    positions: FloatArray
    velocities: FloatArray
    efforts: FloatArray
    fault: str = ""


@dataclass(frozen=True)
class HandState:
    """One measurement: full distance between the fingers and the greatest known [m]; 0 before the first homing."""

    width: float
    max_width: float


class ArmPort(Protocol):
    """Seven joints that follow references while the driver is in control. One thread calls everything."""

    def read(self) -> ArmState:
        """Return the newest state. Raises ConnectionFailedError when the arm is lost."""
        ...

    def begin(self) -> None:
        """Take control; the arm holds where it is. Raises ArmFaultError when it does not let itself be moved."""
        ...

    def follow(self, positions: FloatArray, velocities: FloatArray, accelerations: FloatArray) -> None:
        """Set the reference, each (7,): [rad], [rad/s], [rad/s^2]. Raises ArmFaultError when the arm stopped."""
        ...

    def end(self) -> None:
        """Give control back without waiting; the arm comes to rest and holds."""
        ...

    def recover(self) -> None:
        """Clear the arm's errors. Raises ArmFaultError when it keeps them."""
        ...

    def close(self) -> None:
        """Come to rest and disconnect."""
        ...


class HandMotion(Protocol):
    """One motion of the fingers under way."""

    def wait(self, timeout: float) -> bool:
        """Wait at most `timeout` [s]; return True if the motion has ended."""
        ...

    def succeeded(self) -> bool:
        """Return whether the hand calls the ended motion done. Raises HandFaultError when it failed altogether."""
        ...


class HandPort(Protocol):
    """Two fingers. `read` may be called beside a motion."""

    def read(self) -> HandState:
        """Return the newest state. Raises ConnectionFailedError when the hand is lost."""
        ...

    def move(self, width: float, speed: float) -> HandMotion:
        """Begin to go to a full width [m] at a speed [m/s] of the width."""
        ...

    def grasp(self, width: float, speed: float, force: float, epsilon: tuple[float, float] | None) -> HandMotion:
        """Begin to close to a full width [m] with a force [N]; whatever stops the fingers before is held.

        The motion succeeds where it ends within an epsilon (inner, outer) [m] of the width; None: wherever it ends.
        """
        ...

    def home(self) -> HandMotion:
        """Begin to find the fingers' range."""
        ...

    def stop(self) -> None:
        """Stop the fingers where they are. Raises HandFaultError."""
        ...
