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


def assess(
    joint_age: float, cloud_age: float, arm_ready: bool, gripper_ready: bool, refusal: str | None, busy: bool
) -> HealthReport:
    """Report the worst of what is wrong. Ages in s, infinite when nothing came yet."""
    values = {
        "joint state age [s]": _seconds(joint_age),
        "cloud age [s]": _seconds(cloud_age),
        "arm action server": "ready" if arm_ready else "missing",
        "gripper action server": "ready" if gripper_ready else "missing",
        "busy": str(busy).lower(),
    }
    if not arm_ready or not gripper_ready:
        missing = "arm" if not arm_ready else "gripper"
        return HealthReport(ERROR, f"the {missing}'s action server is missing", values)
    if joint_age > 1.0:
        return HealthReport(ERROR, "joint states are missing or old", values)
    if refusal and not busy:
        return HealthReport(WARN, refusal, values)
    if cloud_age > 2.0 and not busy:
        return HealthReport(WARN, "no fresh point cloud", values)
    return HealthReport(OK, "executing" if busy else "ready", values)


def _seconds(age: float) -> str:
    return f"{age:.2f}" if math.isfinite(age) else "never"
