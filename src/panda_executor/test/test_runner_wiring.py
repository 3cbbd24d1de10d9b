"""What the runner hands on to each run, and what it keeps from one to the next."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from fake_ports import FakeArm, FakeGripper

from cliport_core.action import ActionGoal, PickPlaceAction
from cliport_core.outcome import ActionResult, Outcome
from cliport_core.pose import PlanarPose
from cliport_core.workspace import WorkspaceSpec
from panda_executor import runner as runner_module
from panda_executor.config import ExecutorConfig
from panda_executor.errors import PortError
from panda_executor.motions import Motion
from panda_executor.phase import Phase
from panda_executor.run_commands import RunCommands
from panda_executor.runner import PickPlaceRunner
from panda_model import load_preset

GOAL = ActionGoal(PickPlaceAction(PlanarPose(0.45, 0.1, 0.3), PlanarPose(0.5, -0.2, 0.3)))
SPACE = replace(WorkspaceSpec(), x_max=0.6)
CLOUD = np.arange(6, dtype=np.float32).reshape(2, 3)
CONFIG = replace(ExecutorConfig(), missed_width=0.0125)
LIMITS = load_preset().limits


class Run:
    """A run that is played: it keeps what it was given, and says which of its acts was asked for."""

    made: list[Run]

    def __init__(
        self, planner: Any, commands: RunCommands, goal: ActionGoal, source: Any, workspace: Any, look: Any = None
    ) -> None:
        self.planner, self.commands, self.goal, self.source = planner, commands, goal, source
        self.workspace, self.look = workspace, look
        self.made.append(self)

    def result(self) -> ActionResult:
        return ActionResult(Outcome.SUCCEEDED, "result")

    def go_ready(self) -> ActionResult:
        return ActionResult(Outcome.SUCCEEDED, "go_ready")

    def recover(self) -> ActionResult:
        return ActionResult(Outcome.SUCCEEDED, "recover")

    def open(self) -> ActionResult:
        return ActionResult(Outcome.SUCCEEDED, "open")


@pytest.fixture(autouse=True)
def _played(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Run, "made", [], raising=False)
    monkeypatch.setattr(runner_module, "ActionRun", Run)


def make(config: ExecutorConfig | None = None) -> tuple[PickPlaceRunner, FakeArm, FakeGripper]:
    arm, gripper = FakeArm(), FakeGripper()
    model: Any = SimpleNamespace(limits=LIMITS)
    planner: Any = SimpleNamespace(config=CONFIG)
    return PickPlaceRunner(model, planner, arm, gripper, config), arm, gripper


def test_a_goal_is_run_with_all_that_came_with_it() -> None:
    runner, arm, gripper = make()
    phases: list[tuple[Phase, float]] = []
    plans: list[Any] = []

    def on_plan(motions: Any) -> bool:
        plans.append(motions)
        return True

    def look() -> np.ndarray:
        return CLOUD

    result = runner.run(
        GOAL, CLOUD, SPACE, lambda phase, share: phases.append((phase, share)), lambda: True, on_plan, look
    )
    [run] = Run.made
    assert result.message == "result"
    assert (run.planner, run.goal, run.workspace, run.look) == (runner.planner, GOAL, SPACE, look)
    assert run.source() is CLOUD
    commands = run.commands
    assert commands.should_stop() and commands.config is CONFIG
    commands.progress(Phase.CARRY, 0.0)
    assert [phase for phase, _ in phases] == [Phase.CARRY] and phases[0][1] == pytest.approx(0.6)
    with pytest.raises(Exception, match="cancelled"):
        commands.offer([])
    assert plans == [[]]
    assert commands.width() == 0.08 and gripper.moves == []
    np.testing.assert_array_equal(commands.positions(), arm.positions)
    wanted = CONFIG.motion_limits(LIMITS)
    np.testing.assert_array_equal(commands._limits.velocity, wanted.velocity)
    np.testing.assert_array_equal(commands._limits.jerk, wanted.jerk)


def test_a_cloud_may_be_fetched_only_when_it_is_needed() -> None:
    runner, *_ = make()
    runner.run(GOAL, lambda: CLOUD, SPACE)
    [run] = Run.made
    assert run.source() is CLOUD
    no_motions: list[Motion] = []
    assert run.commands.should_stop() is False and run.commands.offer(no_motions) is False
    assert run.look is None, "nothing but the arm moves"
    run.commands.progress(Phase.CARRY, 0.0)


@pytest.mark.parametrize("name", ["go_ready", "recover"])
def test_a_motion_without_a_goal_sees_what_it_is_shown(name: str) -> None:
    runner, *_ = make()
    assert getattr(runner, name)().message == name
    assert getattr(runner, name)(lambda: True, CLOUD).message == name
    blind, seeing = Run.made
    seen = blind.source()
    assert seen.shape == (1, 3) and seen.dtype == np.float32 and np.isnan(seen).all()
    assert not blind.commands.should_stop()
    assert seeing.source() is CLOUD and seeing.commands.should_stop()
    assert blind.workspace == seeing.workspace == WorkspaceSpec()
    assert not blind.goal.plan_only
    blind.commands.progress(Phase.RECOVERING, 0.0)


def test_the_fingers_open_without_a_goal() -> None:
    runner, *_ = make()
    assert runner.open().message == "open"
    assert runner.open(lambda: True).message == "open"
    assert [run.commands.should_stop() for run in Run.made] == [False, True]


def test_what_the_hand_holds_is_known_to_the_next_run() -> None:
    runner, _, gripper = make()
    gripper.object_width = 0.04
    runner.run(GOAL, CLOUD, SPACE)
    assert runner.held_width() is None
    Run.made[0].commands.move_fingers(0.0, 9.0)
    assert runner.held_width() == 0.04
    runner.go_ready()
    runner.run(GOAL, CLOUD, SPACE)
    for run in Run.made[1:]:
        with pytest.raises(Exception, match="still holds something 40 mm wide"):
            run.commands.check_empty()
    gripper.object_width = 0.0125 - 0.001
    runner.open()
    Run.made[-1].commands.move_fingers(0.08, 9.0)
    Run.made[-1].commands.move_fingers(0.0, 9.0)
    Run.made[-1].commands.check_empty()
    assert runner.held_width() is None


def test_what_is_held_is_not_known_while_the_joint_states_are_old(monkeypatch: pytest.MonkeyPatch) -> None:
    runner, _, gripper = make()

    def old() -> float:
        raise PortError("the joint states are old")

    monkeypatch.setattr(gripper, "width", old)
    assert runner.held_width() is None


def test_a_configuration_of_its_own_goes_before_the_planners() -> None:
    own = replace(CONFIG, missed_width=0.02, timing=replace(CONFIG.timing, velocity_scaling=0.25))
    runner, *_ = make(own)
    runner.open()
    commands = Run.made[0].commands
    assert runner.config is own is commands.config
    np.testing.assert_array_equal(commands._limits.velocity, own.motion_limits(LIMITS).velocity)
    assert make()[0].config is CONFIG


def test_a_planner_is_made_where_none_is_given(monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[Any] = []

    def planner(model: Any, config: Any) -> SimpleNamespace:
        made.append((model, config))
        return SimpleNamespace(config=CONFIG)

    monkeypatch.setattr(runner_module, "TransferPlanner", planner)
    model: Any = SimpleNamespace(limits=LIMITS)
    runner = PickPlaceRunner(model, None, FakeArm(), FakeGripper(), CONFIG)
    assert made == [(model, CONFIG)] and runner.planner.config is CONFIG
