"""The checks: each returns a line of what it measured, or raises with what is wrong."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from panda_driver.conformance.plan import MotionPlan, deviation, small_motion, spread, straight_motion
from panda_driver.conformance.subject import End, RunningGoal, Sample, Subject
from panda_driver.errors import DriverError
from panda_model.limits import FloatArray

_WATCH = 1.0  # for which the joint states are looked at [s]
_OTHER_CLOCK = 1e6  # stamps so far off come from another clock [s]
_FAR = 0.3  # from the arm, where a trajectory must not begin [rad]
_EFFORT = 20.0  # [N]
_HALF_CLOSED = 0.01  # a gripper goal: each finger from the middle [m]
_GRIP_PERIOD = 5.0  # [s]


class CheckFailedError(DriverError):
    """The arm does not do what it should."""


@dataclass(frozen=True)
class Check:
    """A named check; for_hand: whether it needs a hand."""

    name: str
    run: Callable[[Subject], str]
    for_hand: bool = False


def joint_states(subject: Subject) -> str:
    """Check that all joints are reported, often, with stamps that go on and are true."""
    begin, bounds = subject.now(), subject.bounds
    subject.wait(lambda: subject.now() - begin >= _WATCH, 10.0 * _WATCH)
    samples = subject.samples(begin)
    if len(samples) < 2:
        raise CheckFailedError(f"no joint state names all of {', '.join(subject.robot.arm_joints)}")
    stamps = np.array([sample.stamp for sample in samples])
    rate = (len(samples) - 1) / (samples[-1].came - samples[0].came)
    oldest = max(abs(sample.came - sample.stamp) for sample in samples)
    if np.any(np.diff(stamps) <= 0.0):
        raise CheckFailedError("the stamps do not increase")
    if oldest > bounds.age:
        words = f"a stamp is {oldest:.2f} s off the time at which it came (at most {bounds.age:g} s)"
        hint = "; for a simulator's clock give --ros-args -p use_sim_time:=true" if oldest > _OTHER_CLOCK else ""
        raise CheckFailedError(words + hint)
    if rate < bounds.rate:
        raise CheckFailedError(f"{rate:.0f} joint states a second (at least {bounds.rate:g})")
    return f"{rate:.0f} Hz, gaps up to {1000.0 * np.diff(stamps).max():.0f} ms, {1000.0 * oldest:.0f} ms old at most"


def follows(subject: Subject) -> str:
    """Check that a small motion is followed along its path, in its time, to a standstill at its end."""
    plan, bounds = _small(subject), subject.bounds
    begin = subject.now()
    goal = _finish(subject, plan)
    if goal.end is not End.SUCCEEDED:
        raise CheckFailedError(f"the goal {_words(goal)}")
    took = goal.ended_at - begin
    measured = _measured(subject, begin)
    off, short = deviation(plan, measured), float(np.abs(measured[-1] - plan.positions[-1]).max())
    if short > bounds.path:
        raise CheckFailedError(f"it says that it is there, and is {short:.3f} rad away (at most {bounds.path:g})")
    if off > bounds.path:
        raise CheckFailedError(f"{off:.3f} rad off the path (at most {bounds.path:g})")
    if took < plan.duration - bounds.age:
        raise CheckFailedError(f"ended after {took:.2f} s of {plan.duration:g}")
    return f"{1000.0 * off:.1f} mrad off the path, {1000.0 * short:.1f} mrad off its end"


def in_time(subject: Subject) -> str:
    """Check that a motion takes the time that it was given."""
    plan, begin = _small(subject), subject.now()
    goal = _finish(subject, plan)
    took = goal.ended_at - begin
    most = subject.bounds.patience * plan.duration + subject.bounds.spare
    if goal.end is not End.SUCCEEDED or took > most:
        raise CheckFailedError(f"a motion of {plan.duration:g} s {_words(goal)} after {took:.2f} s (at most {most:g})")
    return f"{took:.2f} s for {plan.duration:g} s"


def times_increase(subject: Subject) -> str:
    """Check that a trajectory whose times do not increase is not executed."""
    plan = _small(subject)
    times = plan.times.copy()
    times[10] = times[9]
    return _refuses(subject, replace(plan, times=times))


def joints_are_known(subject: Subject) -> str:
    """Check that a trajectory for other joints is not executed."""
    names = ["somebody_elses_joint", *subject.robot.arm_joints[1:]]
    return _refuses(subject, _small(subject), names)


def within_limits(subject: Subject) -> str:
    """Check that a trajectory that leaves the joints' range is not executed."""
    start = _latest(subject).arm
    end = start.copy()
    end[0] = subject.robot.limits.upper[0] + 0.2
    return _refuses(subject, straight_motion(start, end, 20.0))


def begins_here(subject: Subject) -> str:
    """Check that a trajectory that begins far from the arm is not executed."""
    start = _latest(subject).arm
    return _refuses(subject, _small(subject, start + _FAR * np.sign(_small(subject).positions[-1] - start)))


def cancels(subject: Subject) -> str:
    """Check that a cancel ends the goal soon, and that the arm stands still then."""
    bounds = subject.bounds
    plan = _small(subject)
    plan = replace(plan, times=2.0 * plan.times, velocities=plan.velocities / 2.0)
    goal = subject.follow(subject.robot.arm_joints, plan)
    subject.wait(lambda: goal.end is not None or _way(subject, plan) > 0.25, _most(subject, plan))
    if goal.end is not None or _way(subject, plan) <= 0.25:
        raise CheckFailedError(f"it did not come so far: {_words(goal)}")
    asked = subject.now()
    goal.cancel()
    subject.wait(lambda: goal.end is not None, bounds.patience * bounds.cancel + bounds.spare)
    if goal.end is not End.CANCELED:
        raise CheckFailedError(f"{subject.now() - asked:.1f} s after a cancel the goal {_words(goal)}")
    subject.wait(lambda: subject.now() - goal.ended_at >= bounds.settle, 10.0)
    begin = subject.now()
    subject.wait(lambda: subject.now() - begin >= _WATCH, 10.0 * _WATCH)
    moved = spread(_measured(subject, begin))
    if moved > bounds.still:
        raise CheckFailedError(f"it goes on by {moved:.3f} rad after it was canceled")
    return f"ended {goal.ended_at - asked:.2f} s after it was asked to, then moved by {1000.0 * moved:.1f} mrad"


def one_at_a_time(subject: Subject) -> str:
    """Check that of two goals sent one after the other not both are executed."""
    plan = _small(subject)
    first = subject.follow(subject.robot.arm_joints, plan)
    subject.wait(lambda: first.accepted is not None, subject.bounds.patience + 5.0)
    second = subject.follow(subject.robot.arm_joints, plan)
    subject.wait(lambda: first.end is not None and second.end is not None, _most(subject, plan))
    if first.end is End.SUCCEEDED and second.end is End.SUCCEEDED:
        raise CheckFailedError("both of two goals are said to be done")
    if first.end is None or second.end is None:
        raise CheckFailedError(f"one of two goals never ended: the first {_words(first)}, the second {_words(second)}")
    return f"the first {_words(first)}, the second {_words(second)}"


def hand_moves(subject: Subject) -> str:
    """Check that the fingers go where they are told, and that both actions and joint states say so."""
    lines = []
    for position in (subject.robot.hand.opening / 2.0, _HALF_CLOSED, subject.robot.hand.opening / 2.0):
        goal = subject.grip(position, _EFFORT)
        subject.wait(lambda goal=goal: goal.end is not None, subject.bounds.patience * _GRIP_PERIOD)  # type: ignore[misc]
        if goal.end is not End.SUCCEEDED:
            raise CheckFailedError(f"the fingers' goal of {2.0 * position:g} m {_words(goal)}")
        lines.append(_agreed_width(subject, goal, 2.0 * position))
    return ", ".join(lines)


def hand_range(subject: Subject) -> str:
    """Check that a width that the hand does not have is not accepted."""
    goal = subject.grip(subject.robot.hand.opening, _EFFORT)
    subject.wait(lambda: goal.end is not None, subject.bounds.patience * _GRIP_PERIOD)
    if goal.end not in (End.REJECTED, End.ABORTED):
        raise CheckFailedError(f"twice the hand's opening {_words(goal)}")
    return goal.end.value


CHECKS = (
    Check("joint_states", joint_states),
    Check("follows", follows),
    Check("in_time", in_time),
    Check("times_increase", times_increase),
    Check("joints_are_known", joints_are_known),
    Check("within_limits", within_limits),
    Check("begins_here", begins_here),
    Check("cancels", cancels),
    Check("one_at_a_time", one_at_a_time),
    Check("hand_moves", hand_moves, for_hand=True),
    Check("hand_range", hand_range, for_hand=True),
)


def _agreed_width(subject: Subject, goal: RunningGoal, asked: float) -> str:
    """Compare the width asked for with the result's and with the fingers' joints, each half of it."""
    bounds = subject.bounds
    reported = goal.width if subject.robot.gripper_reports_full_width else 2.0 * goal.width

    def shown() -> float:
        return float(2.0 * _latest(subject).fingers.mean())

    subject.wait(lambda: abs(shown() - asked) < bounds.width, bounds.patience * bounds.spare)
    if abs(reported - asked) > bounds.width:
        raise CheckFailedError(f"the result says {reported:.4f} m for {asked:g} m: the full width, or half of it?")
    if abs(shown() - asked) > bounds.width:
        raise CheckFailedError(f"the fingers' joints make {shown():.4f} m for {asked:g} m: each is half of it")
    return f"{reported:.4f} m for {asked:g} m"


def _latest(subject: Subject) -> Sample:
    samples = subject.samples(subject.now() - 2.0)
    if not samples:
        raise CheckFailedError("no joint states")
    return samples[-1]


def _measured(subject: Subject, since: float) -> list[FloatArray]:
    """Return the positions (7,) [rad] measured from `since` [s] on, one from after the call among them.

    Raises:
        CheckFailedError: when none comes any more: an arm that ends a goal at once would have been seen nowhere.
    """
    now = subject.now()
    if not subject.wait(lambda: bool(subject.samples(now)), 5.0 * subject.bounds.spare):
        raise CheckFailedError("no joint state came after the goal's end")
    return [sample.arm for sample in subject.samples(since)]


def _small(subject: Subject, start: np.ndarray | None = None) -> MotionPlan:
    bounds = subject.bounds
    start = _latest(subject).arm if start is None else start
    return small_motion(start, subject.robot.limits, bounds.amount, bounds.duration)


def _way(subject: Subject, plan: MotionPlan) -> float:
    """Return the share of a motion's way that the arm has gone."""
    gone = np.abs(_latest(subject).arm - plan.positions[0]).max()
    return float(gone / np.abs(plan.positions[-1] - plan.positions[0]).max())


def _most(subject: Subject, plan: MotionPlan) -> float:
    """Return how long to wait for a motion's end, wall clock [s]."""
    return 2.0 * subject.bounds.patience * plan.duration + 5.0 * subject.bounds.spare


def _finish(subject: Subject, plan: MotionPlan) -> RunningGoal:
    goal = subject.follow(subject.robot.arm_joints, plan)
    subject.wait(lambda: goal.end is not None, _most(subject, plan))
    if goal.end is None:
        goal.cancel()
        raise CheckFailedError(f"a motion of {plan.duration:g} s did not end within {_most(subject, plan):g} s")
    return goal


def _refuses(subject: Subject, plan: MotionPlan, joints: list[str] | None = None) -> str:
    """Check that a trajectory is rejected, or aborted before the arm moves."""
    begin = subject.now()
    goal = subject.follow(joints or subject.robot.arm_joints, plan)
    subject.wait(lambda: goal.end is not None, subject.bounds.patience + 5.0 * subject.bounds.spare)
    moved = spread(_measured(subject, begin))
    if goal.end not in (End.REJECTED, End.ABORTED):
        goal.cancel()
        subject.wait(lambda: goal.end is not None, 5.0)
        raise CheckFailedError(f"it was accepted, and {_words(goal)}")
    if moved > subject.bounds.still:
        raise CheckFailedError(f"the arm moved by {moved:.3f} rad before the goal {_words(goal)}")
    return _words(goal)


def _words(goal: RunningGoal) -> str:
    if goal.end is None:
        return "was not answered" if goal.accepted is None else "runs on"
    return f"was {goal.end.value}" + (f" ({goal.words})" if goal.words else "")
