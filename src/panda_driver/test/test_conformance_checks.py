"""The checks in a time that the test turns: what they send, how long they wait, where right ends and wrong begins."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scripted_arm import ROBOT, STEP, Goal, ScriptedArm

from panda_driver.conformance import checks
from panda_driver.conformance.checks import CheckFailedError
from panda_driver.conformance.plan import MotionPlan, small_motion
from panda_driver.conformance.subject import End, Sample


def fails(check: Callable[[ScriptedArm], str], arm: ScriptedArm) -> str:
    with pytest.raises(CheckFailedError) as raised:
        check(arm)
    return str(raised.value)


def test_joint_states_in_words() -> None:
    assert checks.joint_states(ScriptedArm()) == "100 Hz, gaps up to 10 ms, 2 ms old at most"
    assert checks.joint_states(ScriptedArm(period=0.03)) == "33 Hz, gaps up to 30 ms, 2 ms old at most"
    assert fails(checks.joint_states, ScriptedArm(period=0.05)) == "20 joint states a second (at least 25)"
    assert (
        fails(checks.joint_states, ScriptedArm(old=0.3))
        == "a stamp is 0.30 s off the time at which it came (at most 0.25 s)"
    )
    assert "use_sim_time:=true" in fails(checks.joint_states, ScriptedArm(old=2e6))
    assert "use_sim_time" not in fails(checks.joint_states, ScriptedArm(old=5e5))
    assert "no joint state names all of panda_joint1" in fails(checks.joint_states, ScriptedArm(period=30.0))


def test_the_joint_states_are_watched_for_a_second() -> None:
    arm = ScriptedArm()
    begin = arm.now()
    checks.joint_states(arm)
    assert arm.now() - begin == pytest.approx(1.0, abs=2 * STEP)
    assert arm.waits == [10.0]


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ({"short": 0.03}, "it says that it is there, and is 0.030 rad away (at most 0.02)"),
        ({"aside": 0.05}, "rad off the path (at most 0.02)"),
        ({"slow": 0.5}, "ended after 1.0"),
        ({"ends": (End.ABORTED,)}, "the goal was aborted"),
        ({"slow": 9.0}, "a motion of 2 s did not end within 11 s"),
    ],
)
def test_a_motion_that_is_not_followed(wrong: dict[str, object], words: str) -> None:
    assert words in fails(checks.follows, ScriptedArm(**wrong))  # type: ignore[arg-type]


@pytest.mark.parametrize("right", [{"short": 0.019}, {"aside": 0.02}, {"slow": 0.9}, {"slow": 5.0}])
def test_a_motion_that_is_followed_well_enough(right: dict[str, float]) -> None:
    assert "mrad off the path" in checks.follows(ScriptedArm(**right))  # type: ignore[arg-type]


def test_a_motion_is_waited_for_as_long_as_patience_has_it() -> None:
    arm = ScriptedArm()
    checks.follows(arm)
    assert arm.waits == [11.0, 5.0]  # 2 x 1.5 x 2 s + 5 x 1 s for its end, 5 x 1 s for a joint state after it
    joints, plan = arm.sent[0]
    assert joints == tuple(ROBOT.arm_joints)
    wanted = small_motion(np.array(ROBOT.ready), ROBOT.limits, 0.08, 2.0)
    np.testing.assert_allclose(plan.positions, wanted.positions)


def test_a_motion_in_time() -> None:
    assert checks.in_time(ScriptedArm(slow=1.9)).endswith(" s for 2 s")
    late = fails(checks.in_time, ScriptedArm(slow=2.1))
    assert late.startswith("a motion of 2 s was succeeded after 4.2") and late.endswith("(at most 4)")
    assert "was aborted" in fails(checks.in_time, ScriptedArm(ends=(End.ABORTED,)))


REJECTS = (End.REJECTED,)


def sent_by(check: Callable[[ScriptedArm], str]) -> tuple[tuple[str, ...], MotionPlan]:
    arm = ScriptedArm(ends=REJECTS)
    assert check(arm) == "was rejected"
    assert arm.waits == [6.5, 5.0]  # 1.5 + 5 x 1 s for the answer, 5 s for a joint state after it
    return arm.sent[0]


def test_each_wrong_goal_is_wrong_in_one_thing() -> None:
    right = small_motion(np.array(ROBOT.ready), ROBOT.limits, 0.08, 2.0)
    joints, plan = sent_by(checks.times_increase)
    assert joints == tuple(ROBOT.arm_joints)
    assert (np.diff(plan.times) <= 0.0).nonzero()[0].tolist() == [9]
    np.testing.assert_allclose(plan.positions, right.positions)
    joints, plan = sent_by(checks.joints_are_known)
    assert joints == ("somebody_elses_joint", *ROBOT.arm_joints[1:])
    np.testing.assert_allclose(plan.positions, right.positions)
    _, plan = sent_by(checks.within_limits)
    beyond = plan.positions[-1] - ROBOT.limits.upper
    assert beyond[0] == pytest.approx(0.2) and (beyond[1:] < 0.0).all()
    assert plan.duration == 20.0
    np.testing.assert_allclose(plan.positions[0], ROBOT.ready)
    _, plan = sent_by(checks.begins_here)
    np.testing.assert_allclose(np.abs(plan.positions[0] - ROBOT.ready), 0.3)
    assert ROBOT.limits.contains(plan.positions)


def test_a_wrong_goal_that_is_accepted_or_moves_the_arm() -> None:
    arm = ScriptedArm(slow=9.0)
    assert fails(checks.times_increase, arm) == "it was accepted, and was canceled"
    assert arm.waits[-1] == 5.0
    words = fails(checks.begins_here, ScriptedArm(ends=REJECTS, creep=0.0075))
    assert words == "the arm moved by 0.006 rad before the goal was rejected"
    assert checks.begins_here(ScriptedArm(ends=REJECTS, creep=0.003)) == "was rejected"


def test_a_cancel_in_time_and_to_a_standstill() -> None:
    arm = ScriptedArm(answer=0.3)
    assert checks.cancels(arm).startswith("ended 0.3") and arm.goals[0].canceled_at is not None
    assert arm.waits == [17.0, 2.5, 10.0, 10.0, 5.0]
    plan = arm.sent[0][1]
    assert plan.duration == 4.0
    gone = np.abs(arm.arm - plan.positions[0]).max() / np.abs(plan.positions[-1] - plan.positions[0]).max()
    assert 0.25 < gone < 0.3
    np.testing.assert_allclose(np.gradient(plan.positions[:, 0], plan.times)[10], plan.velocities[10, 0], rtol=0.02)
    assert fails(checks.cancels, ScriptedArm(answer=9.0)).startswith("2.5 s after a cancel the goal runs on")
    assert "it goes on by 0.01" in fails(checks.cancels, ScriptedArm(drift=0.01))
    assert "then moved by 3" in checks.cancels(ScriptedArm(drift=0.003))
    assert fails(checks.cancels, ScriptedArm(slow=40.0)) == "it did not come so far: runs on"


def test_what_moves_between_the_cancel_and_the_standstill_is_forgiven() -> None:
    arm = ScriptedArm()
    begin = arm.now()
    checks.cancels(arm)
    ended = arm.goals[0].ended_at
    assert arm.now() - ended == pytest.approx(arm.bounds.settle + 1.0, abs=3 * STEP)
    assert ended > begin


def test_two_goals_at_once() -> None:
    both = fails(checks.one_at_a_time, ScriptedArm())
    assert both == "both of two goals are said to be done"
    arm = ScriptedArm(ends=(End.ABORTED, End.SUCCEEDED))
    assert checks.one_at_a_time(arm) == "the first was aborted, the second was succeeded"
    assert arm.waits == [6.5, 11.0]
    assert checks.one_at_a_time(ScriptedArm(ends=(End.SUCCEEDED, End.REJECTED))).endswith("the second was rejected")
    never = fails(checks.one_at_a_time, ScriptedArm(slow=99.0))
    assert never == "one of two goals never ended: the first runs on, the second runs on"


def test_the_fingers_go_half_open_nearly_closed_and_back() -> None:
    arm = ScriptedArm()
    assert checks.hand_moves(arm) == "0.0800 m for 0.08 m, 0.0200 m for 0.02 m, 0.0800 m for 0.08 m"
    assert arm.grips == [(0.04, 20.0), (0.01, 20.0), (0.04, 20.0)]
    assert arm.waits == [7.5, 1.5] * 3
    assert "of 0.02 m was aborted" in fails(checks.hand_moves, ScriptedArm(ends=(End.SUCCEEDED, End.ABORTED)))
    assert "the result says 0.0850 m for 0.08 m" in fails(checks.hand_moves, ScriptedArm(width_off=0.005))
    assert "the fingers' joints make 0.0850 m for 0.08 m" in fails(checks.hand_moves, ScriptedArm(finger_off=0.005))
    assert checks.hand_moves(ScriptedArm(width_off=0.003, finger_off=-0.003)).startswith("0.0830 m")


def test_a_width_beyond_the_hand() -> None:
    arm = ScriptedArm(ends=REJECTS)
    assert checks.hand_range(arm) == "rejected" and arm.grips == [(0.08, 20.0)] and arm.waits == [7.5]
    assert checks.hand_range(ScriptedArm(ends=(End.ABORTED,))) == "aborted"
    assert fails(checks.hand_range, ScriptedArm()) == "twice the hand's opening was succeeded"


def test_an_arm_that_is_silent() -> None:
    arm = ScriptedArm()
    arm.states.clear()
    arm.period = 100.0
    arm.states.append(Sample(arm.time - 2.5, arm.time - 2.5, arm.arm, arm.fingers))
    assert fails(checks.follows, arm) == "no joint states"
    quiet = ScriptedArm(ends=REJECTS)
    quiet.period = 100.0
    assert fails(checks.begins_here, quiet) == "no joint state came after the goal's end"


def test_words_of_a_goal() -> None:
    goal = Goal(None, 0.0)
    assert checks._words(goal) == "was not answered"
    assert checks._words(replace(goal, accepted=True)) == "runs on"
    assert checks._words(replace(goal, end=End.ABORTED, words="too far")) == "was aborted (too far)"


def test_the_checks_that_need_a_hand() -> None:
    names = [check.name for check in checks.CHECKS if check.for_hand]
    assert names == ["hand_moves", "hand_range"]
