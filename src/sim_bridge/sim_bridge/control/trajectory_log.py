"""A file with every trajectory that the arm's controller took, for tests that check what was sent."""

from __future__ import annotations

import json
from pathlib import Path

from sim_bridge.control.trajectory_goal import TrajectoryGoal
from sim_bridge.errors import SimBridgeError


class TrajectoryLogError(SimBridgeError):
    """The log file cannot be written."""


class TrajectoryLog:
    """Appends a JSON object a line to a file: `time` of acceptance [s], `joint_names`, `times` [s] (N,),
    `positions` [rad], `velocities` [rad/s], `accelerations` [rad/s^2] (N, joints); rows not given are empty.
    """

    def __init__(self, path: str) -> None:
        """Open the log at `path`; an empty path makes a log that keeps nothing. Raises TrajectoryLogError."""
        self._path = Path(path) if path else None
        if self._path is not None:
            self._write("")

    def append(self, goal: TrajectoryGoal, time: float) -> None:
        """Add a goal that was taken at simulated `time` [s]. Raises TrajectoryLogError."""
        if self._path is None:
            return
        line = {
            "time": time,
            "joint_names": goal.joint_names,
            "times": [point.time for point in goal.points],
            "positions": [point.positions for point in goal.points],
            "velocities": [point.velocities for point in goal.points],
            "accelerations": [point.accelerations for point in goal.points],
        }
        self._write(json.dumps(line) + "\n")

    def _write(self, text: str) -> None:
        assert self._path is not None
        try:
            with self._path.open("a", encoding="utf-8") as file:
                file.write(text)
        except OSError as error:
            raise TrajectoryLogError(
                f"cannot write trajectory_log {self._path}: {error.strerror}; name a file that can be written"
            ) from error
