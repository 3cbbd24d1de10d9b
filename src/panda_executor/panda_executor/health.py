"""The executor's report about itself on /diagnostics."""

from __future__ import annotations

import math
from dataclasses import dataclass

OK, WARN, ERROR = 0, 1, 2


@dataclass(frozen=True)
class HealthReport:
    """A diagnostic level, one line, and values by name."""

    level: int
    message: str
    values: dict[str, str]


@dataclass(frozen=True)
class AgeLimits:
    """Ages up to which joint states and clouds are used, and how far ahead of the clock they may be [s]."""

    joints: float
    cloud: float
    ahead: float


def assess(
    joint_age: float,
    cloud_age: float,
    arm_ready: bool,
    gripper_ready: bool,
    refusal: str | None,
    busy: bool,
    limits: AgeLimits,
    held_width: float | None = None,
) -> HealthReport:
    """Report the worst of what is wrong.

    Ages in s, infinite when nothing came yet; held_width: of what the hand is known to hold [m].
    """
    values = {
        "joint state age [s]": _seconds(joint_age),
        "cloud age [s]": _seconds(cloud_age),
        "arm action server": "ready" if arm_ready else "missing",
        "gripper action server": "ready" if gripper_ready else "missing",
        "busy": str(busy).lower(),
        "held width [m]": "none" if held_width is None else f"{held_width:.3f}",
    }
    if not arm_ready or not gripper_ready:
        missing = "arm" if not arm_ready else "gripper"
        return HealthReport(ERROR, f"the {missing}'s action server is missing", values)
    if joint_age > limits.joints:
        return HealthReport(ERROR, "joint states are missing or old", values)
    if joint_age < -limits.ahead:
        return HealthReport(ERROR, "joint states are ahead of the clock", values)
    if refusal and not busy:
        return HealthReport(WARN, refusal, values)
    if cloud_age > limits.cloud and not busy:
        return HealthReport(WARN, "no fresh point cloud", values)
    if cloud_age < -limits.ahead and not busy:
        return HealthReport(WARN, "the point cloud is ahead of the clock", values)
    return HealthReport(OK, "executing" if busy else "ready", values)


def _seconds(age: float) -> str:
    return f"{age:.2f}" if math.isfinite(age) else "never"
