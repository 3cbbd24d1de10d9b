"""Goals that the trajectory controller refuses as they come, and those that its reflex aborts before any motion."""

import numpy as np
import pytest
from controller_bench import HOME, NAMES, Bench, far, point, swing

from sim_bridge.control import ErrorCode, GoalRejectedError, GoalStatus, JointTolerance, TrajectoryGoal

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
