"""Errors between this driver and the arm, each in one line that says what to do."""

from __future__ import annotations

from cliport_core.errors import CoreError


class DriverError(CoreError):
    """Root of the driver's errors."""


class ConnectionFailedError(DriverError):
    """The arm or the hand cannot be reached, or was lost."""


class ArmFaultError(DriverError):
    """The arm stopped by itself or refuses to move."""


class HandFaultError(DriverError):
    """The hand does not do what it was told."""


class HandGoalError(DriverError):
    """A gripper goal that is not taken; carries the value and the range."""
