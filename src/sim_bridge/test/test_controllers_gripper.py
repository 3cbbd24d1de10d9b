"""The hand's controller against franka_gripper's rules, on fingers that meet an object."""

from dataclasses import dataclass

import numpy as np
import pytest

from sim_bridge.control import (
    GoalStatus,
    GripperConfig,
    GripperController,
    GripperGoal,
    GripperGoalError,
    HandFault,
    HandTask,
)

DT = 1.0 / 240.0


@dataclass
class FakeHand:
    """Fingers that follow the command at once and cannot get closer than `thing` [m]."""

    width: float = 0.08
    thing: float = 0.0
    speed: float = 0.0

    @property
    def finger_positions(self):
        return np.full(2, self.width / 2)

    @property
    def finger_velocities(self):
        return np.full(2, self.speed / 2)

    def step(self, command):
        width = max(command.width, self.thing)
        self.speed = (width - self.width) / DT
        self.width = width


class Bench:
    def __init__(self, config=None, **hand):
        self.controller = GripperController(config)
        self.hand = FakeHand(**hand)
        self.time = 0.0

    def run(self, seconds, execution=None):
        for _ in range(round(seconds / DT)):
            command = self.controller.update(self.time, self.hand)
            self.hand.step(command)
            self.time += DT
            if execution is not None and execution.done:
                break
        return command

    def go(self, half_width, effort=20.0, **more):
        self.run(0.02)
        execution = self.controller.start(GripperGoal(half_width, effort, **more), self.time)
        self.run(5.0, execution)
        return execution


def test_position_is_half_a_width_and_the_report_a_full_one():
    bench = Bench(width=0.0)
    execution = bench.go(0.03)
    assert execution.status is GoalStatus.SUCCEEDED
    assert bench.hand.width == pytest.approx(0.06, abs=1e-3)
    assert execution.result.width == pytest.approx(0.06, abs=1e-3)
    assert execution.result.reached_goal
    assert not execution.result.stalled


def test_moves_at_the_hands_speed():
    bench = Bench()
    bench.go(0.01)
    assert bench.time == pytest.approx(0.02 + 0.6 + 0.1, abs=0.05)


def test_a_grasp_on_an_object_reaches_its_goal_and_is_never_stalled():
    bench = Bench(thing=0.04)
    execution = bench.go(0.0)
    assert execution.status is GoalStatus.SUCCEEDED
    result = execution.result
    assert (result.reached_goal, result.stalled) == (True, False)
    assert result.width == pytest.approx(0.04)
    assert result.effort == 20.0
    command = bench.run(1.0)
    assert command.width < 0.02, "the fingers press on"
    assert command.max_effort == 20.0


def test_a_grasp_outside_of_its_epsilon_opens_again():
    bench = Bench(GripperConfig(epsilon_inner=0.005, epsilon_outer=0.005), thing=0.04)
    execution = bench.go(0.0)
    assert execution.status is GoalStatus.ABORTED
    assert not execution.result.reached_goal
    assert "epsilon" in execution.message
    bench.run(1.5)
    assert bench.hand.width == pytest.approx(0.08, abs=1e-3)


def test_without_quirks_an_object_stalls_the_fingers():
    bench = Bench(GripperConfig(franka_quirks=False), thing=0.04)
    execution = bench.go(0.0)
    assert execution.status is GoalStatus.SUCCEEDED
    assert (execution.result.reached_goal, execution.result.stalled) == (False, True)
    assert Bench(GripperConfig(franka_quirks=False)).go(0.01).result.reached_goal


def test_opening_that_is_blocked_is_aborted():
    bench = Bench(width=0.02)
    bench.run(0.02)
    execution = bench.controller.start(GripperGoal(0.04), bench.time)
    for _ in range(1000):
        bench.controller.update(bench.time, bench.hand)
        bench.time += DT
        if execution.done:
            break
    assert execution.status is GoalStatus.ABORTED
    assert "0.0200" in execution.message


def test_open_after_a_grasp():
    bench = Bench(thing=0.04)
    bench.go(0.0)
    execution = bench.go(0.04)
    assert execution.status is GoalStatus.SUCCEEDED
    assert bench.hand.width == pytest.approx(0.08, abs=1e-3)


def test_a_goal_at_the_present_width_succeeds():
    assert Bench().go(0.04).status is GoalStatus.SUCCEEDED


def test_default_and_greatest_effort():
    bench = Bench(thing=0.04)
    assert bench.go(0.0, 0.0).result.effort == 20.0
    bench.go(0.04)
    assert bench.go(0.0, 500.0).result.effort == 60.0


@pytest.mark.parametrize(("position", "effort"), [(0.05, 1.0), (-0.01, 1.0), (np.nan, 1.0), (0.0, -1.0), (0.0, np.inf)])
def test_rejects(position, effort):
    with pytest.raises(GripperGoalError):
        GripperController().start(GripperGoal(position, effort), 0.0)


@pytest.mark.parametrize("stop", ["cancel", "hold"])
def test_stop_holds_the_width(stop):
    bench = Bench()
    bench.run(0.02)
    execution = bench.controller.start(GripperGoal(0.0), bench.time)
    bench.run(0.3)
    bench.controller.cancel() if stop == "cancel" else bench.controller.hold("stopped")
    assert execution.status is (GoalStatus.CANCELED if stop == "cancel" else GoalStatus.ABORTED)
    width = bench.hand.width
    assert 0.04 < width < 0.06
    bench.run(1.0)
    assert bench.hand.width == pytest.approx(width, abs=1e-3)


def test_stop_while_grasping_keeps_the_object():
    bench = Bench(thing=0.04)
    bench.run(0.02)
    bench.controller.start(GripperGoal(0.0), bench.time)
    bench.run(0.45)
    bench.controller.cancel()
    assert bench.run(1.0).width < 0.04 - 1e-3


def test_a_new_goal_aborts_the_old_and_reset_forgets():
    bench = Bench()
    bench.run(0.02)
    first = bench.controller.start(GripperGoal(0.0), bench.time)
    bench.run(0.1)
    second = bench.controller.start(GripperGoal(0.02), bench.time)
    assert first.status is GoalStatus.ABORTED
    assert "preempted" in first.message
    bench.controller.reset("the world was reset")
    assert (second.status, second.message) == (GoalStatus.ABORTED, "the world was reset")
    bench.hand.width = 0.08
    bench.run(1.0)
    assert bench.hand.width == pytest.approx(0.08), "holds the width that it finds"


FRANKA = GripperConfig(epsilon_inner=0.005, epsilon_outer=0.005)  # franka_gripper's own, for GripperCommand


def test_a_grasp_with_an_epsilon_of_its_own_holds_where_a_command_lets_go():
    bench = Bench(FRANKA, thing=0.04)
    grasp = bench.go(0.0, task=HandTask.GRASP, epsilon=(0.08, 0.08))
    assert (grasp.status, grasp.result.width) == (GoalStatus.SUCCEEDED, pytest.approx(0.04))
    assert bench.run(1.0).width < 0.02, "the fingers press on"
    assert Bench(FRANKA, thing=0.04).go(0.0).status is GoalStatus.ABORTED


def test_a_move_goes_to_its_width_at_its_speed_and_is_no_grasp():
    bench = Bench(FRANKA)
    move = bench.go(0.01, task=HandTask.MOVE, speed=0.02)
    assert (move.status, bench.hand.width) == (GoalStatus.SUCCEEDED, pytest.approx(0.02, abs=1e-3))
    assert bench.time == pytest.approx(0.02 + 3.0 + 0.1, abs=0.1)
    blocked = Bench(FRANKA, thing=0.04).go(0.0, task=HandTask.MOVE)
    assert (blocked.status, blocked.message) == (GoalStatus.ABORTED, "stopped at 0.0400 m on the way to 0.0000 m")


def test_a_hand_that_was_never_homed_does_nothing_before_it_is():
    bench = Bench(GripperConfig(fault=HandFault.NEVER_HOMED), width=0.03)
    refused = bench.go(0.0)
    assert (refused.status, refused.message) == (
        GoalStatus.ABORTED, "libfranka gripper: command failed (never_homed)",
    )  # fmt: skip
    bench.run(0.5)
    assert bench.hand.width == pytest.approx(0.03)
    assert bench.go(0.04, task=HandTask.HOMING).status is GoalStatus.SUCCEEDED
    assert bench.go(0.01).status is GoalStatus.SUCCEEDED


@pytest.mark.parametrize("fault", [HandFault.ABORTS, HandFault.LOST])
def test_a_broken_hand_aborts_whatever_it_is_told(fault):
    bench = Bench(GripperConfig(fault=fault))
    for task in HandTask:
        execution = bench.go(0.01, task=task)
        assert (execution.status, execution.result.reached_goal) == (GoalStatus.ABORTED, False)
    assert bench.hand.width == 0.08


def test_a_speed_that_is_none_is_refused():
    with pytest.raises(GripperGoalError, match="speed must be zero"):
        Bench().go(0.01, speed=-0.1)


def test_jammed_fingers_stay_and_say_so_after_a_while():
    bench = Bench(width=0.08)
    bench.controller.jammed_for = 1.0
    execution = bench.go(0.0)
    assert execution.status is GoalStatus.ABORTED and "stopped at 0.0800 m" in execution.message
    assert bench.hand.width == 0.08 and 0.9 < bench.time < 1.2
    bench.controller.jammed_for = None
    assert bench.go(0.02).status is GoalStatus.SUCCEEDED
