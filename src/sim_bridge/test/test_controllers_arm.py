"""The trajectory controller against the rules of the real one, on an arm that follows with a lag."""

from dataclasses import replace

import numpy as np
import pytest
from controller_bench import CONFIG, DT, HOME, NAMES, Bench, FakeArm, far, point, swing

from sim_bridge.control import ErrorCode, GoalStatus, JointTolerance, TrajectoryGoal, TrajectoryPoint
from sim_bridge.control.trajectory_spline import TrajectorySpline, as_knot


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
