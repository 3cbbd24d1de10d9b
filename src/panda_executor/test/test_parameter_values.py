"""The executor's parameters: each has the default that its part has, goes where it belongs, and keeps its range."""

from __future__ import annotations

from dataclasses import asdict, replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import yaml

from cliport_core.workspace import WorkspaceSpec
from panda_executor.arm_watch import ArmWatch
from panda_executor.config import AfterFailure, ExecutorConfig, SearchAlgorithm
from panda_executor.errors import ExecutorError
from panda_executor.node_parameters import NodeParameters, read_parameters
from panda_executor.scene import UnseenRule
from panda_model import load_preset

PANDA = load_preset("panda")


def read(**values: Any) -> NodeParameters:
    def declare(name: str, default: Any) -> SimpleNamespace:
        return SimpleNamespace(value=values.get(name, default))

    return read_parameters(SimpleNamespace(declare_parameter=declare))  # type: ignore[arg-type]


def changed(whole: Any, **values: Any) -> Any:
    """Return a value with other fields, of whatever types those are."""
    return replace(whole, **values)


def check_same(found: Any, wanted: Any) -> None:
    """Compare field by field: some of a robot's are arrays."""
    np.testing.assert_equal(asdict(found), asdict(wanted))


def test_the_defaults() -> None:
    wanted = NodeParameters(
        robot=PANDA,
        robot_description="",
        config=ExecutorConfig.for_arm(PANDA),
        workspace=WorkspaceSpec(),
        max_cloud_age=2.0,
        max_joint_age=0.5,
        cloud_behind=0.0,
        cloud_wait=3.0,
        max_ahead=0.25,
        auto_approve=False,
        approval_time=30.0,
        require_owner=True,
        guard_silence=3.0,
        self_clearance=0.03,
        watch=ArmWatch(),
        owner_silence=0.3,
        work_silence=0.25,
        cameras=1,
    )
    check_same(read(), wanted)


TIMES = ("max_cloud_age", "max_joint_age", "cloud_behind", "cloud_wait", "max_ahead", "approval_time",
         "self_clearance", "owner_silence", "guard_silence", "work_silence")  # fmt: skip


@pytest.mark.parametrize("name", TIMES)
def test_a_number_of_the_node_goes_where_its_name_says(name: str) -> None:
    check_same(read(**{name: 0.625}), changed(read(), **{name: 0.625}))


@pytest.mark.parametrize("name", ["path_tolerance", "goal_tolerance", "goal_time"])
def test_a_demand_on_the_arm(name: str) -> None:
    assert read(**{name: 0.625}).watch == replace(ArmWatch(), **{name: 0.625})


@pytest.mark.parametrize(
    "name", ["velocity_scaling", "acceleration_scaling", "jerk_scaling", "tcp_speed", "tcp_speed_near"]
)
def test_a_number_of_the_timing(name: str) -> None:
    config = ExecutorConfig.for_arm(PANDA)
    assert read(**{name: 0.625}).config == replace(config, timing=replace(config.timing, **{name: 0.625}))


@pytest.mark.parametrize(
    ("name", "value", "kept"),
    [
        ("grip_force", 5.0, 5.0),
        ("planning_time", 9.0, 9.0),
        ("moved_share", 0.25, 0.25),
        ("follow_from", 0.02, 0.02),
        ("clearance", 0.0, 0.0),
        ("straightness", 0.002, 0.002),
        ("after_failure", "open", AfterFailure.OPEN),
        ("after_failure", "stay", AfterFailure.STAY),
    ],
)
def test_a_setting_of_the_core(name: str, value: Any, kept: Any) -> None:
    assert read(**{name: value}).config == replace(ExecutorConfig.for_arm(PANDA), **{name: kept})


@pytest.mark.parametrize(
    ("name", "value", "part", "field", "kept"),
    [
        ("table_z", -0.02, "scene", "table_z", -0.02),
        ("table_tolerance", 0.04, "table", "tolerance", 0.04),
        ("arm_clearance", 0.0, "scene", "arm_clearance", 0.0),
        ("load_clearance", 0.025, "scene", "load_clearance", 0.025),
        ("own_margin", 0.04, "scene", "own_margin", 0.04),
        ("unseen", "free", "scene", "unseen", UnseenRule.FREE),
        ("search", "rrt_star", "search", "algorithm", SearchAlgorithm.RRT_STAR),
        ("seed", 7, "search", "seed", 7),
        ("search_time", 2.5, "search", "time_limit", 2.5),
    ],
)
def test_a_setting_of_a_part(name: str, value: Any, part: str, field: str, kept: Any) -> None:
    config = ExecutorConfig.for_arm(PANDA)
    assert read(**{name: value}).config == replace(config, **{part: replace(getattr(config, part), **{field: kept})})


def test_a_gripper_action_of_ones_own_is_a_gripper_command() -> None:
    check_same(read(gripper_action="").robot, PANDA)
    check_same(read(gripper_action="/other").robot, changed(PANDA, gripper_action="/other", franka_gripper=""))


@pytest.mark.parametrize(("count", "fine"), [(1, True), (9, True), (0, False), (10, False)])
def test_one_to_nine_cameras(count: int, fine: bool) -> None:
    if fine:
        assert read(cameras=count).cameras == count
    else:
        with pytest.raises(ExecutorError, match=f"cameras must be 1 to 9, got {count}"):
            read(cameras=count)


@pytest.mark.parametrize("name", ["base_frame", "arm_action"])
def test_a_name_is_the_presets_unless_there_is_another(name: str) -> None:
    check_same(read(**{name: ""}).robot, PANDA)
    check_same(read(**{name: "/other"}).robot, changed(PANDA, **{name: "/other"}))


@pytest.mark.parametrize("name", ["gripper_reports_full_width", "gripper_reports_stalled"])
@pytest.mark.parametrize("value", [False, True])
def test_what_the_gripper_reports(name: str, value: bool) -> None:
    check_same(read(**{name: value}).robot, changed(PANDA, **{name: value}))


def test_a_robot_and_its_description() -> None:
    check_same(read(robot="fr3").robot, load_preset("fr3"))
    assert read(robot="fr3").config == ExecutorConfig.for_arm(load_preset("fr3"))
    assert read(robot_description="<robot/>").robot_description == "<robot/>"
    assert read(require_owner=False).require_owner is False


def test_a_workspace_of_its_own(tmp_path: Path) -> None:
    mine = replace(WorkspaceSpec(), x_max=WorkspaceSpec().x_max - 0.01)
    path = tmp_path / "workspace.yaml"
    path.write_text(yaml.safe_dump({"workspace": asdict(mine)}))
    assert read(workspace=str(path)).workspace == mine


ARM = list(PANDA.arm_joints)


@pytest.mark.parametrize(
    ("names", "fine"),
    [
        ({"arm_joints": ARM}, True),
        ({"arm_joints": ARM[:6]}, False),
        ({"arm_joints": [*ARM, "eighth"]}, False),
        ({"finger_joints": []}, False),
        ({"finger_joints": ["one"]}, True),
    ],
)
def test_an_arm_has_seven_joints_and_a_finger(names: dict[str, list[str]], fine: bool) -> None:
    if fine:
        robot = read(**names).robot
        assert all(getattr(robot, name) == tuple(value) for name, value in names.items())
    else:
        with pytest.raises(ExecutorError, match="arm_joints must name seven joints and finger_joints at least one"):
            read(**names)


@pytest.mark.parametrize("name", ["velocity_scaling", "acceleration_scaling", "jerk_scaling", "moved_share"])
@pytest.mark.parametrize(("value", "fine"), [(1.0, True), (1.001, False), (0.001, True), (0.0, False), (-0.1, False)])
def test_a_share_is_above_nothing_and_one_at_most(name: str, value: float, fine: bool) -> None:
    if fine:
        read(**{name: value})
    else:
        with pytest.raises(ExecutorError, match=rf"{name} must be in \(0, 1\], got {value:g}"):
            read(**{name: value})


MARGINS = ("arm_clearance", "load_clearance", "own_margin", "clearance")
MOST = PANDA.hand.allowed_force


@pytest.mark.parametrize(
    ("force", "fine"), [(MOST, True), (MOST + 0.1, False), (0.1, True), (0.0, False), (float("nan"), False)]
)
def test_no_more_force_than_the_hand_allows(force: float, fine: bool) -> None:
    if fine:
        assert read(grip_force=force).config.grip_force == force
    else:
        with pytest.raises(ExecutorError, match=rf"grip_force must be in \(0, {MOST:g}\] N, got {force:g}"):
            read(grip_force=force)


@pytest.mark.parametrize("name", ["cloud_behind", "cloud_wait", "max_ahead", *MARGINS])
def test_what_may_be_nothing(name: str) -> None:
    read(**{name: 0.0})
    with pytest.raises(ExecutorError, match=f"{name} must not be negative"):
        read(**{name: -0.001})


@pytest.mark.parametrize(
    "name",
    [*sorted(set(TIMES) - {"cloud_behind", "cloud_wait", "max_ahead", "guard_silence"}), "path_tolerance", "goal_time",
     "tcp_speed", "tcp_speed_near", "table_tolerance", "planning_time", "follow_from", "search_time", "straightness"],
)  # fmt: skip
def test_what_must_be_positive(name: str) -> None:
    read(**{name: 0.001})
    with pytest.raises(ExecutorError, match=f"{name} must be positive, got 0"):
        read(**{name: 0.0})
