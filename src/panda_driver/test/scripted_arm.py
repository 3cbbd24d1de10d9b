"""An arm as the conformance checks see it, in a time that the test turns."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from panda_driver.conformance.plan import MotionPlan
from panda_driver.conformance.subject import Bounds, End, Sample
from panda_model import load_preset

ROBOT = load_preset("panda")
STEP = 0.01


@dataclass
class Goal:
    """A goal as the arm of the test treats it."""

    plan: MotionPlan | None
    began: float
    accepted: bool | None = None
    end: End | None = None
    ended_at: float = 0.0
    words: str = ""
    width: float = 0.0
    stalled: bool = False
    canceled_at: float | None = None

    def cancel(self) -> None:
        self.canceled_at = self.began  # the arm's next tick sets the time


@dataclass
class ScriptedArm:
    """A Subject: an arm that follows a goal, wrong by as much as a test says.

    slow: factor on a motion's time; aside: beside the path on the way, short: at its end, drift: after a cancel [rad];
    creep: while a goal is refused [rad]; answer: from a cancel or a refused goal to its end [s]; ends: what the goals
    end as, one after the other; old: age of a joint state [s]; period: between two [s]; width_off: of the hand's
    answer, finger_off: of its joints [m].
    """

    robot = ROBOT
    bounds: Bounds = field(default_factory=Bounds)
    slow: float = 1.0
    aside: float = 0.0
    short: float = 0.0
    drift: float = 0.0
    answer: float = 0.05
    ends: tuple[End | None, ...] = (End.SUCCEEDED,)
    old: float = 0.002
    period: float = STEP
    width_off: float = 0.0
    finger_off: float = 0.0
    creep: float = 0.0

    def __post_init__(self) -> None:
        self.time, self.waits, self.goals = 50.0, list[float](), list[Goal]()
        self.sent: list[tuple[tuple[str, ...], MotionPlan]] = []
        self.grips: list[tuple[float, float]] = []
        self.arm, self.fingers = np.array(ROBOT.ready), np.array([0.02, 0.02])
        self.states: list[Sample] = []
        for _ in range(20):
            self.tick()

    def now(self) -> float:
        return self.time + 0.1 * STEP  # later than the newest joint state

    def missing(self, seconds: float, with_hand: bool) -> list[str]:
        return []

    def samples(self, since: float) -> list[Sample]:
        return [sample for sample in self.states if sample.came >= since]

    def wait(self, condition: Callable[[], bool], seconds: float) -> bool:
        self.waits.append(round(seconds, 6))
        deadline = self.time + seconds
        while not condition() and self.time < deadline:
            self.tick()
        return condition()

    def tick(self) -> None:
        self.time += STEP
        for goal in self.goals:
            self._advance(goal)
        if not self.states or self.time - self.states[-1].came >= self.period - 1e-9:
            self.states.append(Sample(self.time - self.old, self.time, self.arm.copy(), self.fingers.copy()))

    def _advance(self, goal: Goal) -> None:
        plan = goal.plan
        if plan is None or goal.end is not None:
            if plan is not None and goal.end is End.CANCELED:
                self.arm = self.arm + self.drift * STEP
            return
        if self.ends[0] is End.REJECTED:
            self.arm = self.arm + self.creep * STEP / self.answer
            if self.time - goal.began >= self.answer - 1e-9:
                goal.accepted, goal.end, goal.ended_at, goal.plan = False, End.REJECTED, self.time, None
            return
        goal.accepted = True
        passed = (self.time - goal.began) / self.slow
        if goal.canceled_at is not None:
            goal.canceled_at = self.time if goal.canceled_at == goal.began else goal.canceled_at
            if self.time - goal.canceled_at >= self.answer - 1e-9:
                goal.end, goal.ended_at = End.CANCELED, self.time
            return
        row = np.array([np.interp(passed, plan.times, plan.positions[:, joint]) for joint in range(7)])
        share = min(passed / plan.duration, 1.0)
        row[2] += self.aside * np.sin(np.pi * share) ** 2
        row[1] -= self.short * share
        self.arm = row
        if passed >= plan.duration:
            goal.end = self.ends[min(self.goals.index(goal), len(self.ends) - 1)]
            goal.ended_at = self.time

    def follow(self, joints: Sequence[str], plan: MotionPlan) -> Goal:
        self.sent.append((tuple(joints), plan))
        goal = Goal(plan, self.time)
        self.goals.append(goal)
        return goal

    def grip(self, position: float, effort: float) -> Goal:
        self.grips.append((position, effort))
        end = self.ends[min(len(self.grips) - 1, len(self.ends) - 1)]
        self.fingers = np.full(2, position + self.finger_off / 2.0)
        full = ROBOT.gripper_reports_full_width
        return Goal(None, self.time, True, end, self.time, width=(2.0 if full else 1.0) * position + self.width_off)
