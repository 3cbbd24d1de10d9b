"""What is old, unknown or not finite is not used: clouds, joint states, permission to move."""

from __future__ import annotations

import math
import struct
import threading

import numpy as np
import pytest

from cliport_core.heartbeat import Heartbeat
from panda_executor.cloud_cache import CloudCache, stamp_of_raw
from panda_executor.errors import PortError, RequestError
from panda_executor.gate import Gate
from panda_executor.health import ERROR, OK, WARN, AgeLimits, assess
from panda_executor.joint_tracker import JointTracker
from panda_executor.work_pulse import WorkPulse

S = 1_000_000_000
ARM = tuple(f"panda_joint{i}" for i in range(1, 8))
FINGERS = ("panda_finger_joint1", "panda_finger_joint2")


def raw(seconds: float) -> bytes:
    whole, rest = divmod(round(seconds * S), S)
    return b"\x00\x01\x00\x00" + struct.pack("<iI", whole, rest) + b"the rest"


def test_the_stamp_is_read_without_the_message() -> None:
    assert stamp_of_raw(raw(12.25)) == 12_250_000_000
    assert stamp_of_raw(b"short") == 0


def test_a_fresh_cloud_is_given_as_it_came() -> None:
    cache = CloudCache()
    assert cache.age(0) == math.inf
    cache.put(raw(10.0))
    cache.put(raw(11.0))
    assert cache.age(12 * S) == pytest.approx(1.0)
    assert cache.get(13 * S, 0, 0) == raw(11.0)
    assert cache.get(12 * S, 11 * S, 11 * S) == raw(11.0)
    assert cache.get(12 * S, 10 * S, 0) == raw(11.0)


@pytest.mark.parametrize(
    ("now", "goal", "still", "words"),
    [
        (12.01, 0, 0, r"2\.0 s old \(at most 2 s\)"),
        (10.5, 10.001, 0, r"0\.0 s older than the goal's observation \(at most 0 s\); raise cloud_behind"),
        (11.5, 11.2, 0, r"1\.2 s older than the goal's observation"),
        (10.5, 9.0, 10.2, r"while the arm still moved, 0\.2 s before its last motion's end; raise cloud_wait"),
    ],
)
def test_an_unfit_cloud_is_refused(now: float, goal: float, still: float, words: str) -> None:
    cache = CloudCache()
    cache.put(raw(10.0))
    with pytest.raises(RequestError, match=words) as caught:
        cache.get(round(now * S), round(goal * S), round(still * S))
    assert "\n" not in str(caught.value)


def test_no_cloud_is_refused() -> None:
    with pytest.raises(RequestError, match="is perception running"):
        CloudCache().get(0, 0, 0)


def test_a_cloud_may_be_a_little_behind_when_told_so() -> None:
    cache = CloudCache(behind=0.5)
    cache.put(raw(10.0))
    assert cache.get(round(10.5 * S), round(10.4 * S), 0) == raw(10.0)
    with pytest.raises(RequestError, match="older than the goal's observation"):
        cache.get(round(10.7 * S), round(10.6 * S), 0)


def test_no_cloud_from_before_perceptions_complaint_is_given_out() -> None:
    cache = CloudCache(max_age=10.0)
    cache.complain("the camera was moved", 9 * S)
    with pytest.raises(RequestError, match="the camera was moved"):
        cache.get(10 * S, 0, 0)
    cache.put(raw(10.0))
    assert cache.get(11 * S, 0, 0) == raw(10.0) == cache.since(11 * S, 0)
    cache.complain("the camera was moved", 11 * S)
    with pytest.raises(RequestError, match="the camera was moved"):
        cache.since(11 * S, 0)
    with pytest.raises(RequestError, match="the camera was moved"):
        cache.get(12 * S, 0, 0)
    cache.put(raw(11.5))
    assert cache.get(12 * S, 0, 0) == raw(11.5), "the camera was put back"
    cache.complain("by another clock", 900 * S)
    assert cache.get(12 * S, 0, 0) == raw(11.5) == cache.since(12 * S, 0)


@pytest.fixture
def tracker() -> JointTracker:
    joints = JointTracker(ARM, FINGERS)
    joints.update(("other", *reversed(ARM)), [99.0, *np.arange(7.0)], 10 * S)
    joints.update(FINGERS, [0.02, 0.03], 10 * S)
    return joints


def test_joints_come_in_any_order_and_in_parts(tracker: JointTracker) -> None:
    np.testing.assert_array_equal(tracker.arm_positions(10 * S), np.arange(7.0)[::-1])
    assert tracker.width(10 * S) == pytest.approx(0.05)
    assert tracker.age(10 * S + S // 4) == pytest.approx(0.25)


def test_one_finger_is_enough() -> None:
    joints = JointTracker(ARM, FINGERS)
    joints.update(FINGERS[:1], [0.02], 0)
    assert joints.width(0) == pytest.approx(0.04)


def test_missing_and_old_joints_are_errors(tracker: JointTracker) -> None:
    empty = JointTracker(ARM, FINGERS)
    assert empty.age(0) == math.inf
    for call in (empty.arm_positions, empty.width):
        with pytest.raises(PortError, match="not in the joint states"):
            call(0)
    for call in (tracker.arm_positions, tracker.width):
        with pytest.raises(PortError, match=r"0\.6 s old \(at most 0\.5 s\)"):
            call(10 * S + 6 * S // 10)
    tracker.update(ARM[:6], np.zeros(6), 11 * S)
    with pytest.raises(PortError, match="panda_joint7"):
        tracker.arm_positions(11 * S)


def test_positions_that_are_not_finite_are_not_taken(tracker: JointTracker) -> None:
    """A driver reports NaN until its hardware is up: a hand of unknown width would never seem empty."""
    tracker.update((FINGERS[1], ARM[2]), [math.nan, math.inf], 11 * S)
    assert tracker.width(10 * S) == pytest.approx(0.05)
    assert np.isfinite(tracker.arm_positions(10 * S)).all()
    for call in (tracker.arm_positions, tracker.width):
        with pytest.raises(PortError, match="s old"):
            call(11 * S)


def test_one_request_at_a_time() -> None:
    gate = Gate()
    assert (gate.refusal(), gate.busy, gate.stopped) == (None, False, False)
    assert gate.enter() is None
    assert gate.busy
    assert gate.enter() == "another goal is being executed"
    gate.leave()
    assert gate.enter() is None


def test_a_stop_latches_and_a_close_is_for_good() -> None:
    gate = Gate()
    assert gate.enter() is None
    gate.latch("stopped on request")
    assert gate.stopped
    gate.leave()
    assert gate.enter() == "stopped on request; call /panda_executor/resume first"
    assert not gate.busy
    gate.release()
    assert not gate.stopped
    assert gate.enter() is None
    gate.close()
    gate.release()
    gate.leave()
    assert gate.stopped
    assert gate.enter() == "the executor is shutting down"


def test_a_stop_ends_a_request_for_good() -> None:
    """Stop, then resume: the goal that was stopped must not go on, and the next one may."""
    gate = Gate()
    assert gate.enter() is None
    gate.latch("stopped on request")
    gate.release()
    assert gate.stopped, "the goal would be revived"
    gate.leave()
    assert not gate.stopped
    assert gate.enter() is None
    assert not gate.stopped


def test_the_gate_opens_at_a_standstill_only() -> None:
    resting: list[bool] = [False]
    gate = Gate(lambda: resting[0])
    assert gate.enter() is None  # nothing was moved yet
    gate.note_motion()
    gate.leave()
    assert "not seen to stand still" in str(gate.enter())
    resting[0] = True
    assert gate.enter() is None
    resting[0] = False
    gate.leave()
    assert gate.enter() is None


def test_an_arm_that_came_to_rest_before_the_request_ended_may_be_moved_by_hand_after_it() -> None:
    resting = [True]
    gate = Gate(lambda: resting[0])
    assert gate.enter() is None
    gate.note_motion()
    gate.leave()
    resting[0] = False
    assert gate.enter() is None


def test_a_standstill_is_measured(tracker: JointTracker) -> None:
    joints = JointTracker(ARM, FINGERS)
    assert not joints.is_still(0)
    for step in range(10):
        joints.update(ARM, np.full(7, 0.001 * step), step * S // 50)
    now = 9 * S // 50
    assert not joints.is_still(now)  # 0.05 rad/s
    for step in range(10, 16):
        joints.update(ARM, np.full(7, 0.009), step * S // 50)
    assert joints.is_still(15 * S // 50)
    assert not joints.is_still(60 * S // 50), "old"
    assert not joints.is_still(-S), "from the future"


def test_positions_from_the_future_are_refused(tracker: JointTracker) -> None:
    with pytest.raises(PortError, match=r"1\.0 s ahead of the clock \(at most 0\.25 s\)"):
        tracker.arm_positions(9 * S)
    cache = CloudCache()
    cache.put(raw(10.0))
    with pytest.raises(RequestError, match=r"cloud is 1\.0 s ahead of the clock"):
        cache.get(9 * S, 0, 0)


def test_a_thread_that_only_lives_gives_no_sign_of_life() -> None:
    now = [0.0]
    pulse = WorkPulse(lambda: now[0], longest=0.25)
    now[0] = 9.0
    assert pulse.is_alive()  # nothing runs
    pulse.begin()
    now[0] = 9.2
    assert pulse.is_alive()
    pulse.beat()
    now[0] = 9.4
    assert pulse.is_alive()
    now[0] = 9.5
    assert not pulse.is_alive()
    pulse.end()
    assert pulse.is_alive()


def test_a_motion_whose_end_nobody_can_hear_is_not_watched() -> None:
    """The thread that spins the node died: results and joint states do not come any more, nor do cancels go."""
    now = [0.0]
    pulse = WorkPulse(lambda: now[0], longest=0.25)
    pulse.turn()
    now[0] = 1.0
    assert pulse.is_alive()  # nothing runs
    pulse.begin()
    assert not pulse.is_alive()
    pulse.turn()
    assert pulse.is_alive()
    now[0] = 1.2
    pulse.beat()
    now[0] = 1.3
    assert not pulse.is_alive()


def test_only_one_of_many_threads_enters() -> None:
    gate, entered = Gate(), []
    threads = [threading.Thread(target=lambda: entered.append(gate.enter())) for _ in range(16)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert entered.count(None) == 1


def test_the_heart_beats_until_it_is_stopped() -> None:
    beats: list[int] = []
    enough = threading.Event()

    def beat() -> None:
        beats.append(1)
        if len(beats) == 5:
            enough.set()

    heart = Heartbeat(beat, period=0.005)
    assert enough.wait(5.0)
    heart.stop()
    count = len(beats)
    assert not threading.Event().wait(0.03)
    assert len(beats) == count


@pytest.mark.parametrize(
    ("changes", "level", "message"),
    [
        ({}, OK, "ready"),
        ({"busy": True, "refusal": "another goal is being executed", "cloud_age": 9.0}, OK, "executing"),
        ({"arm_ready": False}, ERROR, "the arm's action server is missing"),
        ({"gripper_ready": False}, ERROR, "the gripper's action server is missing"),
        ({"joint_age": math.inf}, ERROR, "joint states are missing or old"),
        ({"joint_age": 0.7}, ERROR, "joint states are missing or old"),
        ({"joint_age": -0.3}, ERROR, "joint states are ahead of the clock"),
        ({"cloud_age": -0.3}, WARN, "the point cloud is ahead of the clock"),
        ({"refusal": "stopped"}, WARN, "stopped"),
        ({"cloud_age": 2.5}, WARN, "no fresh point cloud"),
    ],
)
def test_the_worst_is_reported(changes: dict[str, object], level: int, message: str) -> None:
    state: dict[str, object] = {
        "joint_age": 0.01, "cloud_age": 0.1, "arm_ready": True, "gripper_ready": True, "refusal": None, "busy": False,
        "limits": AgeLimits(joints=0.5, cloud=2.0, ahead=0.25),
    }  # fmt: skip
    report = assess(**(state | changes))  # type: ignore[arg-type]
    assert (report.level, report.message) == (level, message)
    assert report.values["arm action server"] == ("missing" if "arm_ready" in changes else "ready")
    assert report.values["gripper action server"] == ("missing" if "gripper_ready" in changes else "ready")
    assert report.values["busy"] == ("true" if "busy" in changes else "false")
    if "joint_age" not in changes:
        assert report.values["joint state age [s]"] == "0.01"
