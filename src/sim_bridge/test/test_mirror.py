"""A simulated arm that follows another's joint states, fingers and time included."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from cliport_core import Pose
from panda_model import load_preset
from sim_bridge.mirror import SQUEEZE, Mirror, Reported
from sim_bridge.objects import block_shape
from sim_bridge.robot import HAND, ROBOT
from sim_bridge.world import SimWorld

RATE = 150.0  # of the reports [Hz]


def follow(world: SimWorld, mirror: Mirror, reports: list[Reported]) -> None:
    """Do what a loop does for reports that come one after the other."""
    for one in reports:
        mirror.report(one)
        for _ in range(mirror.due(0.0)):
            state = world.panda.state()
            arm, hand = mirror.arm.update(world.time, state), mirror.hand.update(world.time, state)
            world.panda.command(arm.positions, arm.velocities)
            world.panda.command_fingers(hand.width, hand.max_effort)
            world.step()


def reports(begin: float, seconds: float, way: float, width: float) -> list[Reported]:
    """Make reports of a smooth motion of the first joint by `way` [rad] from the ready pose."""
    times = np.arange(1, int(seconds * RATE) + 1) / RATE
    share = times / seconds
    places = way * (3.0 * share**2 - 2.0 * share**3)
    speeds = way * 6.0 * (share - share**2) / seconds
    turned = [np.r_[place, np.zeros(6)] for place in places]
    return [
        Reported(begin + time, ROBOT.ready + at, np.r_[speed, np.zeros(6)], width)
        for time, at, speed in zip(times, turned, speeds)
    ]


@pytest.fixture
def world() -> SimWorld:
    return SimWorld()


def test_arm_and_time_are_the_others(world: SimWorld) -> None:
    mirror = Mirror(world)
    assert mirror.due(0.0) == 0 and mirror.delay(0.0) > 0.0
    follow(world, mirror, reports(0.0, 2.0, 0.6, HAND.opening))
    assert world.time == pytest.approx(2.0, abs=world.dt)
    assert np.abs(world.panda.state().positions - ROBOT.ready - np.r_[0.6, np.zeros(6)]).max() < 0.003


def test_a_world_that_is_far_behind_is_there_at_once_and_one_that_is_ahead_waits(world: SimWorld) -> None:
    mirror = Mirror(world)
    follow(world, mirror, reports(20.0, 0.1, 0.0, HAND.opening)[:1])
    assert world.time == pytest.approx(20.0, abs=0.02)
    world.skip(1.0)
    follow(world, mirror, reports(20.1, 0.1, 0.0, HAND.opening))
    assert world.time == pytest.approx(21.0, abs=0.02)


def test_fingers_close_as_reported_and_stop_at_what_is_there(world: SimWorld) -> None:
    mirror = Mirror(world)
    follow(world, mirror, reports(0.0, 0.5, 0.0, HAND.opening))
    follow(world, mirror, reports(0.5, 1.0, 0.0, 0.05))
    assert world.panda.state().width == pytest.approx(0.05 - SQUEEZE, abs=0.002)
    tcp = world.panda.tcp_in_base()
    follow(world, mirror, reports(1.5, 1.0, 0.0, HAND.opening))
    thing = world.add(block_shape(), Pose(np.eye(3), tcp.translation), "red", fixed=True)
    follow(world, mirror, reports(2.5, 1.0, 0.0, 0.04))
    assert world.panda.state().width == pytest.approx(0.04, abs=0.002)
    world.remove(thing)


def test_an_older_report_is_no_news(world: SimWorld) -> None:
    mirror = Mirror(world)
    new, old = reports(1.0, 0.02, 0.1, 0.08)[-1], reports(0.5, 0.02, 0.3, 0.02)[-1]
    mirror.report(new)
    mirror.report(old)
    assert mirror.newest is new


def test_fingers_of_which_nothing_is_said_stay(world: SimWorld) -> None:
    mirror = Mirror(world)
    states = reports(0.0, 0.04, 0.1, 0.03)
    mirror.report(states[0])
    mirror.report(replace(states[2], width=None))
    assert mirror.newest is not None and (mirror.newest.time, mirror.newest.width) == (states[2].time, 0.03)


def test_what_a_message_says_of_the_arm_whatever_else_it_holds() -> None:
    """Joints in any order, among others; too little of it says nothing, and ends no callback."""
    messages = pytest.importorskip("sensor_msgs.msg")
    from sim_bridge.node_mirror import reported_from_msg

    arm = load_preset()
    names = [*reversed(arm.arm_joints), "wheel", *arm.finger_joints]
    places = [0.7, 0.6, 0.5, 0.4, 0.3, 0.2, 0.1, 9.0, 0.02, 0.01]
    whole = messages.JointState(name=names, position=places, velocity=[10.0 * place for place in places])
    found = reported_from_msg(whole, arm)
    assert found is not None and found.width == pytest.approx(0.03)
    np.testing.assert_allclose(found.positions, np.arange(1, 8) / 10.0)
    np.testing.assert_allclose(found.velocities, np.arange(1, 8))
    alone = messages.JointState(name=names[:8], position=places[:8], velocity=places[:8])
    found = reported_from_msg(alone, arm)
    assert found is not None and found.width is None
    assert reported_from_msg(messages.JointState(name=names, position=places), arm) is None
    assert reported_from_msg(messages.JointState(name=names[1:], position=places[1:], velocity=places[1:]), arm) is None
