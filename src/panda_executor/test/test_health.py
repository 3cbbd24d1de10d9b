"""The report on /diagnostics: what is wrong is named, the worst first, at each limit."""

from __future__ import annotations

import math
from typing import Any

import pytest

from panda_executor.health import ERROR, OK, WARN, AgeLimits, assess

LIMITS = AgeLimits(joints=0.5, cloud=2.0, ahead=0.25)
GOOD: dict[str, Any] = {
    "joint_age": 0.1, "cloud_age": 1.0, "arm_ready": True, "gripper_ready": True, "refusal": None, "busy": False,
}  # fmt: skip
CLOUD, AHEAD = (WARN, "no fresh point cloud"), (WARN, "the point cloud is ahead of the clock")
JOINTS, EARLY = (ERROR, "joint states are missing or old"), (ERROR, "joint states are ahead of the clock")
ARM, GRIPPER = (ERROR, "the arm's action server is missing"), (ERROR, "the gripper's action server is missing")


@pytest.mark.parametrize(
    ("case", "report"),
    [
        ({}, (OK, "ready")),
        ({"busy": True}, (OK, "executing")),
        ({"arm_ready": False}, ARM),
        ({"gripper_ready": False}, GRIPPER),
        ({"arm_ready": False, "gripper_ready": False}, ARM),
        ({"arm_ready": False, "joint_age": 9.0, "refusal": "stopped", "busy": True}, ARM),
        ({"joint_age": 0.5}, (OK, "ready")),
        ({"joint_age": 0.51}, JOINTS),
        ({"joint_age": math.inf, "busy": True}, JOINTS),
        ({"joint_age": 9.0, "refusal": "stopped"}, JOINTS),
        ({"joint_age": -0.25}, (OK, "ready")),
        ({"joint_age": -0.26}, EARLY),
        ({"joint_age": -0.26, "busy": True, "refusal": "stopped"}, EARLY),
        ({"refusal": "stopped"}, (WARN, "stopped")),
        ({"refusal": "stopped", "cloud_age": 9.0}, (WARN, "stopped")),
        ({"refusal": "another goal is being executed", "busy": True}, (OK, "executing")),
        ({"cloud_age": 2.0}, (OK, "ready")),
        ({"cloud_age": 2.01}, CLOUD),
        ({"cloud_age": 2.01, "busy": True}, (OK, "executing")),
        ({"cloud_age": -0.25}, (OK, "ready")),
        ({"cloud_age": -0.26}, AHEAD),
        ({"cloud_age": -0.26, "busy": True}, (OK, "executing")),
    ],
)
def test_the_worst_is_named(case: dict[str, Any], report: tuple[int, str]) -> None:
    assessed = assess(**{**GOOD, **case}, limits=LIMITS)
    assert (assessed.level, assessed.message) == report


def test_levels_are_those_of_the_message() -> None:
    assert (OK, WARN, ERROR) == (0, 1, 2)


def test_values_are_shown_by_name() -> None:
    assert assess(0.123, math.inf, True, False, None, False, LIMITS).values == {
        "joint state age [s]": "0.12",
        "cloud age [s]": "never",
        "arm action server": "ready",
        "gripper action server": "missing",
        "busy": "false",
        "held width [m]": "none",
    }
    values = assess(math.inf, 4.567, False, True, None, True, LIMITS, 0.0404).values
    assert list(values.values()) == ["never", "4.57", "missing", "ready", "true", "0.040"]
