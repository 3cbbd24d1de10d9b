"""A joint trajectory as it is sent to the arm's controller."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from panda_executor.errors import TrajectoryError
from panda_model.limits import ARM_DOF, FloatArray


@dataclass(frozen=True, eq=False)
class JointTrajectory:
    """Points of a motion.

    times: (N,) [s] from the start; positions, velocities, accelerations (N, 7) [rad, rad/s, rad/s^2].
    """

    joint_names: tuple[str, ...]
    times: FloatArray
    positions: FloatArray
    velocities: FloatArray
    accelerations: FloatArray

    def __post_init__(self) -> None:
        shape = (len(self.times), len(self.joint_names))
        for name in ("positions", "velocities", "accelerations"):
            if getattr(self, name).shape != shape:
                raise TrajectoryError(f"{name} have shape {getattr(self, name).shape}, expected {shape}")
        if shape[0] < 2 or shape[1] != ARM_DOF:
            raise TrajectoryError(f"a trajectory needs two points or more of {ARM_DOF} joints, got {shape}")

    @property
    def duration(self) -> float:
        """Duration of the whole motion [s]."""
        return float(self.times[-1])

    @property
    def start(self) -> FloatArray:
        """First configuration (7,) [rad]."""
        return self.positions[0]

    @property
    def end(self) -> FloatArray:
        """Last configuration (7,) [rad]."""
        return self.positions[-1]

    def sample(self, times: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Return positions and first three derivatives, each (M, 7), at times (M,) [s].

        Between the points runs the quintic that matches position, velocity and acceleration at both ends:
        what a joint trajectory controller does with points that carry all three.
        """
        t = np.clip(np.asarray(times, dtype=np.float64), self.times[0], self.times[-1])
        k = np.clip(np.searchsorted(self.times, t, side="right") - 1, 0, len(self.times) - 2)
        span = (self.times[k + 1] - self.times[k])[:, None]
        u = (t[:, None] - self.times[k][:, None]) / span
        p0, v0, a0 = self.positions[k], self.velocities[k] * span, self.accelerations[k] * span**2
        p1 = self.positions[k + 1]
        v1, a1 = self.velocities[k + 1] * span, self.accelerations[k + 1] * span**2
        c2 = a0 / 2.0
        c3 = 10.0 * (p1 - p0) - 6.0 * v0 - 4.0 * v1 - 1.5 * a0 + 0.5 * a1
        c4 = -15.0 * (p1 - p0) + 8.0 * v0 + 7.0 * v1 + 1.5 * a0 - a1
        c5 = 6.0 * (p1 - p0) - 3.0 * (v0 + v1) - 0.5 * a0 + 0.5 * a1
        position = p0 + u * (v0 + u * (c2 + u * (c3 + u * (c4 + u * c5))))
        velocity = v0 + u * (2.0 * c2 + u * (3.0 * c3 + u * (4.0 * c4 + u * 5.0 * c5)))
        acceleration = 2.0 * c2 + u * (6.0 * c3 + u * (12.0 * c4 + u * 20.0 * c5))
        jerk = 6.0 * c3 + u * (24.0 * c4 + u * 60.0 * c5)
        return position, velocity / span, acceleration / span**2, jerk / span**3
