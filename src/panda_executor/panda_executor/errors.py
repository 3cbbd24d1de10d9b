"""Errors of panda_executor: one root, values carried, the remedy named."""

from __future__ import annotations

from cliport_core.outcome import Refusal


class ExecutorError(Exception):
    """Root of everything that this package raises on purpose."""


class RobotDescriptionError(ExecutorError):
    """The robot's description files are missing or lack something that is needed."""


class RequestError(ExecutorError):
    """A request that must be refused before anything moves.

    refusal: why; value, limit: what was found and what would have been allowed, in SI units, None where there is no
    such number.
    """

    def __init__(
        self,
        message: str,
        refusal: Refusal = Refusal.MALFORMED,
        value: float | None = None,
        limit: float | None = None,
    ) -> None:
        super().__init__(message)
        self.refusal, self.value, self.limit = refusal, value, limit


class InverseKinematicsError(ExecutorError):
    """No joint configuration puts the hand, pointing down, where it was asked to be."""

    def __init__(self, x: float, y: float, z: float, yaw: float, residual: float) -> None:
        super().__init__(
            f"the hand cannot reach ({x:.3f}, {y:.3f}, {z:.3f}) m at yaw {yaw:.2f} rad pointing down "
            f"(best attempt is off by {residual * 1000.0:.1f} mm); choose a pose nearer to the robot"
        )
        self.x, self.y, self.z, self.yaw, self.residual = x, y, z, yaw, residual


class GraspError(ExecutorError):
    """The cloud at the pick gives no grasp: nothing seen, nothing above the table, or too wide."""


class PlanningError(ExecutorError):
    """No path that keeps the limits and touches nothing."""


class BudgetSpentError(PlanningError):
    """Planning was stopped, or took longer than it may; nothing else is to be tried."""


class TrajectoryError(ExecutorError):
    """A trajectory that must not be sent: malformed, beyond a limit, or in collision."""


class PortError(ExecutorError):
    """The arm or the gripper does not answer."""
