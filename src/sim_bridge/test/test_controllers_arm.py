"""The trajectory controller against the rules of the real one, on an arm that follows with a lag."""

from dataclasses import dataclass, field, replace

import numpy as np
import pytest

from sim_bridge.control import (
    ArmControllerConfig,
    ErrorCode,
    GoalRejectedError,
    GoalStatus,
    JointTolerance,
    JointTrajectoryController,
    TrajectoryGoal,
    TrajectoryPoint,
)
from sim_bridge.control.trajectory_spline import TrajectorySpline, as_knot

CONFIG = ArmControllerConfig()
NAMES = CONFIG.joint_names
HOME = np.array([0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785])
DT = 1.0 / 240.0


@dataclass
class FakeArm:
    """Moves a share of the way to its command each step; `stuck` joints do not move."""

    positions: np.ndarray = field(default_factory=lambda: HOME.copy())
    velocities: np.ndarray = field(default_factory=lambda: np.zeros(7))
    stuck: bool = False

    def step(self, command):
        target = self.positions if self.stuck else command.positions
        following = self.positions + 0.5 * (target - self.positions)
        self.velocities = (following - self.positions) / DT
        self.positions = following


@dataclass
class Bench:
    controller: JointTrajectoryController = field(default_factory=JointTrajectoryController)
    arm: FakeArm = field(default_factory=FakeArm)
    time: float = 0.0
    commands: list = field(default_factory=list)

    def run(self, seconds, execution=None):
        for _ in range(round(seconds / DT)):
            command = self.controller.update(self.time, self.arm)
            self.commands.append(command)
            self.arm.step(command)
            self.time += DT
            if execution is not None and execution.done:
                break

    def start(self, goal):
        return self.controller.start(goal, self.time)


def swing(angle=0.5, seconds=1.5, **changes):
    """Joint 1 by `angle`, smoothly, from rest to rest."""
    end = HOME.copy()
    end[0] += angle
    middle, speed = (HOME + end) / 2.0, np.zeros(7)
    speed[0] = 1.875 * angle / seconds  # of a quintic from rest to rest
    goal = TrajectoryGoal.from_arrays(
        NAMES,
        [0.0, seconds / 2.0, seconds],
        [HOME, middle, end],
        [np.zeros(7), speed, np.zeros(7)],
        np.zeros((3, 7)),
    )
    return replace(goal, **changes)


def test_follows_to_the_end():
    bench = Bench()
    execution = bench.start(swing(0.5))
    bench.run(3.0, execution)
    assert execution.status is GoalStatus.SUCCEEDED
    assert execution.error_code is ErrorCode.SUCCESSFUL
    assert bench.arm.positions[0] == pytest.approx(0.5, abs=0.01)
    assert bench.time == pytest.approx(1.5, abs=0.1)
    assert bench.controller.active is None


def test_joints_in_any_order():
    goal = swing(0.4)
    order = [6, 2, 0, 5, 1, 4, 3]
    points = tuple(
        TrajectoryPoint(
            p.time,
            *(tuple(values[i] for i in order) for values in (p.positions, p.velocities, p.accelerations)),
        )
        for p in goal.points
    )
    bench = Bench()
    execution = bench.start(replace(goal, joint_names=tuple(NAMES[i] for i in order), points=points))
    bench.run(3.0, execution)
    assert execution.status is GoalStatus.SUCCEEDED
    assert bench.arm.positions[0] == pytest.approx(0.4, abs=0.01)
    assert bench.arm.positions[1:] == pytest.approx(HOME[1:], abs=1e-6)


def point(time, positions=HOME, velocities=(), accelerations=()):
    return TrajectoryPoint(time, tuple(positions), tuple(velocities), tuple(accelerations))


REJECTED = {
    "a joint is missing": (
        TrajectoryGoal(NAMES[:6], (point(1.0, HOME[:6]),)),
        ErrorCode.INVALID_JOINTS,
        "panda_joint7",
    ),
    "a foreign joint": (
        TrajectoryGoal((*NAMES[:6], "elbow"), (point(1.0),)),
        ErrorCode.INVALID_JOINTS,
        "elbow",
    ),
    "a joint twice": (
        TrajectoryGoal((*NAMES[:6], NAMES[0]), (point(1.0),)),
        ErrorCode.INVALID_JOINTS,
        "panda_joint7",
    ),
    "no points": (TrajectoryGoal(NAMES, ()), ErrorCode.INVALID_GOAL, "no points"),
    "equal times": (TrajectoryGoal(NAMES, (point(1.0), point(1.0))), ErrorCode.INVALID_GOAL, "point 1"),
    "negative time": (TrajectoryGoal(NAMES, (point(-1.0),)), ErrorCode.INVALID_GOAL, "negative"),
    "time not a number": (TrajectoryGoal(NAMES, (point(float("nan")),)), ErrorCode.INVALID_GOAL, "increase"),
    "six positions": (TrajectoryGoal(NAMES, (point(1.0, HOME[:6]),)), ErrorCode.INVALID_GOAL, "6 positions"),
    "six velocities": (
        TrajectoryGoal(NAMES, (point(1.0, HOME, [0] * 6),)),
        ErrorCode.INVALID_GOAL,
        "6 velocities",
    ),
    "a NaN": (TrajectoryGoal(NAMES, (point(1.0, [np.nan] * 7),)), ErrorCode.INVALID_GOAL, "not finite"),
    "moving end": (TrajectoryGoal(NAMES, (point(1.0, HOME, [0.1] * 7),)), ErrorCode.INVALID_GOAL, "at rest"),
    "only accelerations": (
        TrajectoryGoal(NAMES, (point(1.0, HOME, (), [0] * 7),)),
        ErrorCode.INVALID_GOAL,
        "no vel",
    ),
    "in the past": (
        TrajectoryGoal(NAMES, (point(1.0),), start_time=8.0),
        ErrorCode.OLD_HEADER_TIMESTAMP,
        "1.000 s",
    ),
    "more than a minute ahead": (
        TrajectoryGoal(NAMES, (point(1.0),), start_time=70.4),
        ErrorCode.INVALID_GOAL,
        r"60\.4 s from now \(limit 60 s\)",
    ),
    "another clock": (
        TrajectoryGoal(NAMES, (point(1.0),), start_time=1.7e9),
        ErrorCode.INVALID_GOAL,
        "use_sim_time",
    ),
    "bad tolerance": (
        TrajectoryGoal(NAMES, (point(1.0),), path_tolerance={NAMES[0]: JointTolerance(-2.0)}),
        ErrorCode.INVALID_GOAL,
        "unlimited",
    ),
    "tolerance of a stranger": (
        TrajectoryGoal(NAMES, (point(1.0),), goal_tolerance={"elbow": JointTolerance()}),
        ErrorCode.INVALID_JOINTS,
        "elbow",
    ),
    "negative goal time": (
        TrajectoryGoal(NAMES, (point(1.0),), goal_time_tolerance=-1.0),
        ErrorCode.INVALID_GOAL,
        "goal_time_tolerance",
    ),
}


@pytest.mark.parametrize("case", REJECTED)
def test_rejects(case):
    goal, code, words = REJECTED[case]
    bench = Bench(time=10.0)
    with pytest.raises(GoalRejectedError, match=words) as error:
        bench.start(goal)
    assert error.value.code is code
    assert "\n" not in str(error.value)
    assert bench.controller.active is None


def far(joint, value):
    positions = HOME.copy()
    positions[joint] = value
    return positions


REFLEXES = {
    "the first point is elsewhere": [point(0.0, HOME + 0.3, [0] * 7), point(2.0, HOME, [0] * 7)],
    "a single waypoint": [point(1.0, far(0, 0.5))],
    "a corner": [point(0.0), point(1.0), point(2.0, far(0, 0.5))],
    "too fast": [point(0.0, HOME, [0] * 7), point(0.5, far(0, 1.0), [0] * 7)],
    "beyond a limit": [point(0.0, HOME, [0] * 7), point(9.0, far(5, 3.9), [0] * 7)],
    "moves at once": [point(0.0, HOME, [0.5] * 7), point(1.0, HOME + 0.2, [0] * 7)],
}


@pytest.mark.parametrize("case", REFLEXES)
def test_reflexes_abort_before_motion(case):
    bench = Bench()
    execution = bench.start(TrajectoryGoal(NAMES, tuple(REFLEXES[case])))
    bench.run(0.5)
    assert execution.status is GoalStatus.ABORTED
    assert execution.error_string.startswith("reflex: ")
    assert bench.arm.positions == pytest.approx(HOME, abs=1e-9)


@pytest.mark.parametrize("case", REFLEXES)
def test_a_check_beforehand_finds_what_would_be_aborted(case):
    bench = Bench()
    with pytest.raises(GoalRejectedError) as error:
        bench.controller.check(TrajectoryGoal(NAMES, tuple(REFLEXES[case])), bench.time, bench.arm)
    assert error.value.code is ErrorCode.INVALID_GOAL
    bench.controller.check(swing(), bench.time, bench.arm)
    assert bench.controller.active is None


def test_a_waypoint_with_velocity_is_led_in_smoothly():
    bench = Bench()
    execution = bench.start(TrajectoryGoal(NAMES, (point(1.0, far(0, 0.3), [0] * 7, [0] * 7),)))
    bench.run(2.0, execution)
    assert execution.status is GoalStatus.SUCCEEDED


@pytest.mark.parametrize("stop", ["cancel", "hold"])
@pytest.mark.parametrize("moment", [0.3, 0.75, 1.2])
def test_stops_on_its_path_within_limits(stop, moment):
    bench = Bench()
    execution = bench.start(swing(1.2))
    bench.run(moment)
    assert abs(bench.commands[-1].velocities[0]) > 0.3
    moving = len(bench.commands)
    if stop == "cancel":
        bench.controller.cancel()
        assert execution.status is GoalStatus.CANCELING
    else:
        bench.controller.hold("heartbeat lost")
        assert (execution.status, execution.error_string) == (GoalStatus.ABORTED, "heartbeat lost")
    bench.run(0.3)
    assert execution.done
    held = bench.commands[-1].positions.copy()
    bench.run(1.0)
    assert bench.commands[-1].positions == pytest.approx(held, abs=1e-12)
    assert abs(bench.arm.positions[0] - held[0]) < 1e-6
    speeds = np.array([c.velocities[0] for c in bench.commands[moving - 1 :]])
    assert np.abs(np.diff(speeds)).max() / DT < 1.3 * CONFIG.acceleration[0]
    path = np.array([c.positions[0] for c in bench.commands])
    assert np.abs(np.diff(path) / DT).max() < CONFIG.velocity[0]


def test_cancel_before_the_first_update():
    bench = Bench()
    execution = bench.start(swing())
    bench.controller.cancel()
    assert execution.status is GoalStatus.CANCELED
    bench.run(0.5)
    assert bench.arm.positions == pytest.approx(HOME)


def test_a_new_goal_aborts_the_old():
    bench = Bench()
    first = bench.start(swing())
    bench.run(0.05)
    second = bench.start(TrajectoryGoal(NAMES, (point(1.5, far(0, -0.2), [0] * 7, [0] * 7),)))
    assert first.status is GoalStatus.ABORTED
    assert "preempted" in first.error_string
    bench.run(3.0, second)
    assert second.status is GoalStatus.SUCCEEDED
    assert bench.arm.positions[0] == pytest.approx(-0.2, abs=0.01)


def test_a_new_goal_that_trips_the_reflex_stops_the_arm():
    bench = Bench()
    bench.start(swing(1.2))
    bench.run(0.7)
    second = bench.start(swing(1.2))
    bench.run(0.4)
    assert second.status is GoalStatus.ABORTED
    assert bench.commands[-1].velocities == pytest.approx(np.zeros(7))


def test_path_tolerance():
    bench = Bench()
    execution = bench.start(swing(path_tolerance={NAMES[0]: JointTolerance(0.05)}))
    bench.run(0.3)
    bench.arm.stuck = True
    bench.run(1.0, execution)
    assert execution.status is GoalStatus.ABORTED
    assert execution.error_code is ErrorCode.PATH_TOLERANCE_VIOLATED
    bench.arm.stuck = False
    bench.run(0.5)
    assert bench.commands[-1].positions == pytest.approx(bench.arm.positions, abs=1e-6)
    assert bench.arm.positions[0] < 0.2


@pytest.mark.parametrize(("allowance", "code"), [(0.5, ErrorCode.GOAL_TOLERANCE_VIOLATED), (0.0, None)])
def test_goal_time(allowance, code):
    """Stuck short of the goal: aborted after the allowance, or waited for when it is zero."""
    bench = Bench()
    unlimited = {name: JointTolerance(-1.0, -1.0) for name in NAMES}
    execution = bench.start(swing(path_tolerance=unlimited, goal_time_tolerance=allowance))
    bench.run(0.6)
    bench.arm.stuck = True
    bench.run(5.0, execution)
    if code is None:
        assert execution.status is GoalStatus.EXECUTING
        bench.arm.stuck = False
        bench.run(0.5, execution)
        assert execution.status is GoalStatus.SUCCEEDED
    else:
        assert execution.error_code is code
        assert bench.time == pytest.approx(2.0, abs=0.1)


def test_unlimited_goal_tolerance_accepts_anything():
    bench = Bench()
    bench.arm.stuck = True
    unlimited = {name: JointTolerance(-1.0, -1.0) for name in NAMES}
    execution = bench.start(swing(path_tolerance=unlimited, goal_tolerance=unlimited))
    bench.run(2.0, execution)
    assert execution.status is GoalStatus.SUCCEEDED


def test_start_times():
    bench = Bench(time=5.0)
    late = bench.start(swing(seconds=2.0, start_time=6.0))
    bench.run(0.9)
    assert bench.arm.positions == pytest.approx(HOME, abs=1e-6)
    bench.run(3.0, late)
    assert late.status is GoalStatus.SUCCEEDED
    assert bench.time == pytest.approx(8.0, abs=0.1)


def test_reset_holds_where_the_arm_is():
    bench = Bench()
    execution = bench.start(swing())
    bench.run(0.5)
    bench.controller.reset("the world was reset")
    assert (execution.status, execution.error_string) == (GoalStatus.ABORTED, "the world was reset")
    bench.arm = FakeArm(HOME + 0.1)
    bench.run(0.2)
    assert bench.arm.positions == pytest.approx(HOME + 0.1)


def test_feedback():
    bench = Bench()
    assert bench.controller.feedback() is None
    bench.start(swing())
    bench.run(0.6)
    feedback = bench.controller.feedback()
    assert feedback.desired.velocities[0] > 0.1
    assert abs(feedback.desired.positions[0] - feedback.positions[0]) < 0.02


@pytest.mark.parametrize("order", [1, 3, 5])
def test_spline_meets_its_knots_and_derives_right(order):
    rng = np.random.default_rng(order)
    times = [0.0, 0.7, 1.1, 2.0]
    knots = [
        as_knot(
            t,
            rng.normal(size=7),
            rng.normal(size=7) if order > 1 else (),
            rng.normal(size=7) if order > 3 else (),
        )
        for t in times
    ]
    spline = TrajectorySpline(knots)
    for knot in knots[:-1]:
        q, v, a = spline.sample(knot.time)
        assert q == pytest.approx(knot.positions)
        if order > 1:
            assert v == pytest.approx(knot.velocities)
        if order > 3:
            assert a == pytest.approx(knot.accelerations)
    h = 1e-5
    for t in (0.2, 0.9, 1.7):
        (before, slow, _), (_, v, a), (after, fast, _) = (spline.sample(t + d) for d in (-h, 0.0, h))
        assert v == pytest.approx((after - before) / (2 * h), rel=1e-5, abs=1e-6)
        assert a == pytest.approx((fast - slow) / (2 * h), rel=1e-4, abs=1e-5)
    assert spline.sample(99.0)[0] == pytest.approx(knots[-1].positions)
    swept, positions, _ = spline.sweep(0.01)
    assert np.diff(swept).max() <= 0.01 + 1e-9
    assert positions[-1] == pytest.approx(knots[-1].positions)
