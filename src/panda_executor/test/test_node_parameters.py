"""The executor's and the guard's parameters, without a process for each."""

from __future__ import annotations

import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import yaml

from cliport_core.errors import CoreError
from panda_executor.config import AfterFailure, SearchAlgorithm
from panda_executor.errors import ExecutorError
from panda_executor.node_parameters import NodeParameters, read_parameters

LAUNCH = Path(__file__).resolve().parents[3] / "src/cliport_bringup/launch"


class Declaring:
    """A node whose parameters are what the test sets, else their defaults."""

    def __init__(self, **values: Any) -> None:
        self.values, self.declared = values, set[str]()

    def declare_parameter(self, name: str, default: Any) -> SimpleNamespace:
        self.declared.add(name)
        return SimpleNamespace(value=self.values.get(name, default))


def read(**values: Any) -> NodeParameters:
    node = Declaring(**values)
    parameters = read_parameters(node)  # type: ignore[arg-type]
    assert set(values) <= node.declared
    return parameters


FINITE = ("max_joint_age", "max_cloud_age", "cloud_wait", "cloud_behind", "max_ahead", "table_z", "owner_silence",
          "guard_silence", "work_silence", "approval_time", "planning_time", "search_time", "tcp_speed", "goal_time",
          "arm_clearance", "load_clearance", "own_margin", "clearance", "straightness")  # fmt: skip


@pytest.mark.parametrize("name", FINITE)
@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_what_is_not_finite_is_refused(name: str, value: float) -> None:
    """An age of NaN would let joint states and clouds of any age pass."""
    with pytest.raises(ExecutorError, match=f"{name} must be finite, got {value:g}"):
        read(**{name: value})


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("max_joint_age", -1.0, "max_joint_age must be positive, got -1"),
        ("max_cloud_age", 0.0, "max_cloud_age must be positive, got 0"),
        ("cloud_wait", -0.1, "cloud_wait must not be negative, got -0.1"),
        ("moved_share", 1.5, r"moved_share must be in \(0, 1\], got 1.5"),
        ("after_failure", "hide", "unknown after_failure 'hide'; known are stay, keep, open"),
        ("velocity_scaling", 1.5, r"velocity_scaling must be in \(0, 1\], got 1.5"),
        ("arm_clearance", -0.01, "arm_clearance must not be negative, got -0.01"),
        ("unseen", "guess", "unknown unseen 'guess'; known are free, shadow"),
        ("search", "prm", "unknown search 'prm'; known are rrt_star, rrt_connect"),
    ],
)
def test_what_is_out_of_range_is_named(name: str, value: Any, words: str) -> None:
    with pytest.raises(ExecutorError, match=words):
        read(**{name: value})


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("robot", "pr2", "unknown robot 'pr2'; known are fr3, panda"),
        ("workspace", "/nowhere/workspace.yaml", "/nowhere/workspace.yaml"),
    ],
)
def test_a_file_that_is_not_there_is_named(name: str, value: str, words: str) -> None:
    with pytest.raises(CoreError, match=words):
        read(**{name: value})


def test_what_messages_name_as_a_remedy_can_be_set() -> None:
    config = read(planning_time=9.0, moved_share=0.7, after_failure="open", search_time=3.0, search="rrt_star").config
    assert (config.planning_time, config.moved_share, config.after_failure) == (9.0, 0.7, AfterFailure.OPEN)
    assert (config.search.time_limit, config.search.algorithm) == (3.0, SearchAlgorithm.RRT_STAR)


def test_names_of_the_driver_leave_the_descriptions_alone() -> None:
    robot = read(base_frame="world", finger_joints=["left", "right"], robot="fr3").robot
    assert (robot.base_frame, robot.finger_joints, robot.prefix) == ("world", ("left", "right"), "fr3_")


def test_a_person_approves_unless_told_otherwise_by_name() -> None:
    assert read().auto_approve is False
    assert read(auto_approve=True).auto_approve is True
    asked = {}
    for name in ("policy.launch.yaml", "sim.launch.yaml"):
        launch = yaml.safe_load((LAUNCH / name).read_text())["launch"]
        defaults = {part["arg"]["name"]: part["arg"]["default"] for part in launch if "default" in part.get("arg", {})}
        asked[name] = defaults["auto_approve"]
    assert asked == {"policy.launch.yaml": "false", "sim.launch.yaml": "true"}
