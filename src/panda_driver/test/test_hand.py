"""The hand by franka_gripper's rule, with `stalled` told as it is."""

from __future__ import annotations

import threading

import pytest
from fake_franka import ARM, FakeHand

from panda_driver.errors import ConnectionFailedError, HandFaultError, HandGoalError
from panda_driver.hand import Hand
from sim_bridge.control.goal_status import GoalStatus
from sim_bridge.control.gripper_controller import GripperGoal, HandTask

CLOSE, OPEN, HALF = GripperGoal(0.0, 20.0), GripperGoal(0.04), GripperGoal(0.02)


def make(port: FakeHand) -> Hand:
    return Hand(lambda: port, ARM.hand, lambda _: None)


def test_closing_on_an_object_is_a_grasp_held_and_stalled() -> None:
    hand = make(FakeHand(0.03))
    status, result, _ = hand.execute(CLOSE)
    assert status is GoalStatus.SUCCEEDED
    assert (result.width, result.stalled, result.reached_goal, result.effort) == (0.03, True, False, 20.0)


def test_closing_on_nothing_reaches_its_goal() -> None:
    port = FakeHand()
    status, result, _ = make(port).execute(CLOSE)
    assert (status, result.width, result.stalled, result.reached_goal) == (GoalStatus.SUCCEEDED, 0.0, False, True)
    assert (port.told, port.forces) == ([("grasp", 0.0)], [20.0])


@pytest.mark.parametrize(("asked", "force"), [(0.0, 20.0), (35.0, 35.0)])
def test_a_grasp_without_an_effort_has_the_usual_force(asked: float, force: float) -> None:
    port = FakeHand(0.03)
    make(port).execute(GripperGoal(0.0, asked))
    assert port.forces == [force]


def test_a_position_is_half_a_width_and_opening_is_a_move() -> None:
    port = FakeHand()
    hand = make(port)
    hand.execute(HALF)
    hand.execute(OPEN)
    assert port.told == [("grasp", 0.04), ("move", 0.08)]
    assert hand.state.width == 0.08


def test_fingers_that_something_keeps_from_opening_are_aborted() -> None:
    port = FakeHand()
    hand = make(port)
    hand.execute(CLOSE)
    port.move = lambda width, speed: port._go("move", width, 0.01)  # type: ignore[method-assign]
    status, result, words = hand.execute(OPEN)
    assert (status, result.stalled) == (GoalStatus.ABORTED, False)
    assert "stand at 0.0100 m, asked for 0.0800 m" in words


def test_a_grasp_that_the_hand_calls_failed_is_no_grasp() -> None:
    port = FakeHand(0.03)
    port.does = False
    status, result, _ = make(port).execute(CLOSE)
    assert (status, result.stalled, result.width) == (GoalStatus.ABORTED, False, 0.03)


def test_a_grasp_is_judged_by_its_own_epsilon() -> None:
    port = FakeHand(0.03)
    hand = make(port)
    wide = hand.execute(GripperGoal(0.0, 30.0, HandTask.GRASP, 0.05, (0.08, 0.08)))
    assert (wide[0], wide[1].width, port.told, port.forces) == (GoalStatus.SUCCEEDED, 0.03, [("grasp", 0.0)], [30.0])
    status, _, words = hand.execute(GripperGoal(0.0, 30.0, HandTask.GRASP, 0.05, (0.005, 0.005)))
    assert (status, words) == (GoalStatus.ABORTED, "the fingers stand at 0.0300 m, outside of the grasp's epsilon")


def test_a_move_closes_without_a_grasp_and_homing_is_a_goal() -> None:
    port = FakeHand()
    hand = make(port)
    assert hand.execute(GripperGoal(0.01, task=HandTask.MOVE))[0] is GoalStatus.SUCCEEDED
    assert hand.execute(GripperGoal(0.0, task=HandTask.HOMING))[0] is GoalStatus.SUCCEEDED
    assert (port.told, port.forces) == ([("move", 0.02), ("home", 0.0)], [])


def test_a_halt_stops_the_fingers() -> None:
    port = FakeHand()
    port.ends = False
    hand = make(port)
    ends: list[GoalStatus] = []
    thread = threading.Thread(target=lambda: ends.append(hand.execute(CLOSE)[0]))
    thread.start()
    while not hand.moving or not port.told:
        threading.Event().wait(0.01)
    with pytest.raises(HandGoalError, match="another goal is executed"):
        hand.check(CLOSE)
    with pytest.raises(HandFaultError, match="a goal is executed"):
        hand.home()
    hand.halt()
    thread.join(20.0)
    assert (ends, port.stops) == ([GoalStatus.CANCELED], 1)


@pytest.mark.parametrize(
    ("goal", "words"),
    [
        (GripperGoal(0.05), "half a width: it must be in 0..0.04 m"),
        (GripperGoal(float("nan")), "half a width"),
        (GripperGoal(0.02, -1.0), "max_effort must be zero"),
        (GripperGoal(0.02, speed=-1.0), "speed must be zero"),
    ],
)
def test_goals_outside_the_range_are_refused(goal: GripperGoal, words: str) -> None:
    with pytest.raises(HandGoalError, match=words):
        make(FakeHand()).check(goal)


def test_a_hand_that_was_never_homed_says_so() -> None:
    port = FakeHand()
    port.max_width = 0.0
    hand = make(port)
    with pytest.raises(HandGoalError, match="call ~/home_gripper"):
        hand.check(CLOSE)


def test_a_hand_that_fails_aborts_in_words() -> None:
    port = FakeHand()
    port.fails = "the hand failed: no power"
    status, _, words = make(port).execute(CLOSE)
    assert (status, words) == (GoalStatus.ABORTED, "the hand failed: no power")


def test_a_hand_that_is_lost_while_it_is_told_ends_the_goal(monkeypatch: pytest.MonkeyPatch) -> None:
    port = FakeHand()

    def lost(*_: object) -> None:
        raise ConnectionFailedError("the hand was lost")

    monkeypatch.setattr(port, "grasp", lost)
    hand = make(port)
    status, _, words = hand.execute(CLOSE)
    assert (status, words, hand.moving) == (GoalStatus.ABORTED, "the hand was lost", False)


def test_a_lost_hand_refuses_until_homing_connects_it_again() -> None:
    ports, losses = [FakeHand(), FakeHand()], list[str]()
    lost = threading.Event()

    def cut() -> None:
        raise ConnectionFailedError("the hand was lost")

    def on_loss(words: str) -> None:
        losses.append(words)
        lost.set()

    offered = iter(ports)
    hand = Hand(lambda: next(offered), ARM.hand, on_loss, period=0.001)
    hand.start_thread()
    assert hand.is_fresh()
    ports[0].read = cut  # type: ignore[assignment]
    assert lost.wait(20.0)
    assert (hand.lost, hand.is_fresh()) == ("the hand was lost", False)
    with pytest.raises(HandGoalError, match="the hand was lost"):
        hand.check(CLOSE)
    hand.home()
    assert (hand.lost, ports[1].told) == ("", [("home", 0.0)])
    hand.check(CLOSE)
    assert hand.execute(CLOSE)[0] is GoalStatus.SUCCEEDED
    hand.stop_thread()
    assert losses == ["the hand was lost"]


def test_the_state_of_a_hand_that_answers_no_more_is_not_fresh(monkeypatch: pytest.MonkeyPatch) -> None:
    hand = make(FakeHand())
    assert hand.is_fresh()
    read_at = hand._read_at
    monkeypatch.setattr("panda_driver.hand.clock.monotonic", lambda: read_at + 0.3)
    assert not hand.is_fresh()
