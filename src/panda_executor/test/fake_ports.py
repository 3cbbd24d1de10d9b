"""An arm and a gripper that obey at once."""

from __future__ import annotations

from collections.abc import Callable
from copy import deepcopy
from dataclasses import dataclass, field

import numpy as np

from panda_executor.ports import GripperResult, MotionResult, MotionStatus, ShouldStop
from panda_executor.trajectory import JointTrajectory
from panda_model import FloatArray, load_preset

_ABORTED = MotionResult(MotionStatus.ABORTED, "path tolerance violated")


@dataclass
class FakeArm:
    """Follows every trajectory exactly, in as many steps as it has points.

    fail_at: number of the motion (from 0) that ends with `failure` half-way. on_step is called with the
    motion's number and the share done, between points.
    """

    positions: FloatArray = field(default_factory=lambda: load_preset().ready.copy())
    fail_at: int | None = None
    failure: MotionResult = _ABORTED
    fail_share: float = 0.51
    on_step: Callable[[int, float], None] = lambda motion, share: None
    sent: list[JointTrajectory] = field(default_factory=list)
    standing: bool = True  # whether it is measured at rest once it was stopped

    def joint_positions(self) -> FloatArray:
        """Return the positions (7,) [rad]."""
        return np.array(self.positions)

    def execute(self, trajectory: JointTrajectory, should_stop: ShouldStop) -> MotionResult:
        """Jump from point to point."""
        number = len(self.sent)
        trajectory = deepcopy(trajectory)  # a test may push the arm off it, and the plan stays as it is
        self.sent.append(trajectory)
        for i, positions in enumerate(trajectory.positions):
            share = i / (len(trajectory.positions) - 1)
            self.on_step(number, share)
            if should_stop():
                return MotionResult(MotionStatus.CANCELLED, "stopped", self.standing)
            if number == self.fail_at and share >= self.fail_share:
                return self.failure
            self.positions = np.array(positions)
        return MotionResult(MotionStatus.SUCCEEDED)


@dataclass
class FakeGripper:
    """Closes down to object_width [m], 0 for nothing between the fingers."""

    opening: float = field(default_factory=lambda: load_preset().hand.opening)
    object_width: float = 0.04
    failure: GripperResult | None = None
    moves: list[float] = field(default_factory=list)
    stops: int = 0

    def width(self) -> float:
        """Return the full distance between the fingers [m]."""
        return self.opening

    def move(self, width: float, max_effort: float, should_stop: ShouldStop) -> GripperResult:
        """Close or open at once, as far as the object lets it."""
        self.moves.append(width)
        if should_stop():
            return GripperResult(self.opening, False, False, MotionStatus.CANCELLED, "stopped")
        if self.failure is not None:
            return self.failure
        self.opening = max(width, self.object_width) if width < self.opening else width
        return GripperResult(self.opening, self.opening > width + 1e-4, abs(self.opening - width) < 1e-4)

    def stop(self) -> None:
        """Count the calls."""
        self.stops += 1

    def lose_object(self) -> None:
        """Let the object slip out: the fingers close all the way."""
        self.object_width = 0.0
        self.opening = 0.0
