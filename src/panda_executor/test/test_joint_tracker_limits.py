"""What is known of the joints, at each limit, and against a standstill judged in the slow and obvious way."""

from __future__ import annotations

import math

import numpy as np
import pytest

from panda_executor.errors import PortError
from panda_executor.joint_tracker import JointTracker
from panda_model import FloatArray

MS = 1_000_000
S = 1000 * MS
ARM = tuple(f"j{i}" for i in range(1, 8))
FINGERS = ("f1", "f2")
REST = np.array([0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7])


def tracker(*arm: tuple[int, FloatArray], max_age: float = 0.5, max_ahead: float = 0.25) -> JointTracker:
    joints = JointTracker(ARM, FINGERS, max_age, max_ahead)
    for stamp_ns, positions in arm:
        joints.update(ARM, positions.tolist(), stamp_ns)
    return joints


@pytest.mark.parametrize(
    ("late_ms", "still"), [(0, True), (500, True), (501, False), (5000, False), (-250, True), (-251, False)]
)
def test_only_fresh_states_show_a_standstill(late_ms: int, still: bool) -> None:
    joints = JointTracker(ARM, FINGERS)  # the defaults: 0.5 s old at most, 0.25 s ahead
    joints.update(ARM, REST.tolist(), 10 * S)
    joints.update(ARM, REST.tolist(), 10 * S + 50 * MS)
    assert joints.is_still(10 * S + (50 + late_ms) * MS) is still


@pytest.mark.parametrize(
    ("late_ms", "words"),
    [
        (0, None),
        (500, None),
        (600, r"'j3' is 0\.6 s old \(at most 0\.5 s\)"),
        (-250, None),
        (-300, r"'j3' is 0\.3 s ahead of the clock \(at most 0\.25 s\)"),
    ],
)
def test_positions_are_given_out_while_they_are_fresh(late_ms: int, words: str | None) -> None:
    joints = JointTracker(ARM, FINGERS)
    now = 10 * S
    joints.update((*ARM[:2], *ARM[3:]), [*REST[:2], *REST[3:]], now)
    joints.update(("j3",), (9.0,), now - late_ms * MS)
    if words is not None:
        with pytest.raises(PortError, match=words):
            joints.arm_positions(now)
        return
    np.testing.assert_array_equal(joints.arm_positions(now), [*REST[:2], 9.0, *REST[3:]])


@pytest.mark.parametrize(("behind_ms", "taken"), [(-5, True), (0, True), (1, False), (200, False), (201, True)])
def test_a_position_that_came_late_is_dropped_unless_the_clock_was_set_back(behind_ms: int, taken: bool) -> None:
    joints = tracker((10 * S, REST))
    joints.update(("j1",), (5.0,), 10 * S - behind_ms * MS)
    assert joints.arm_positions(10 * S)[0] == (5.0 if taken else 0.1)


def test_the_age_is_that_of_the_oldest_joint_that_is_needed() -> None:
    joints = JointTracker(ARM, FINGERS)
    joints.update(ARM[:6], REST[:6].tolist(), 10 * S)
    joints.update(FINGERS, (0.01, 0.02), 10 * S)
    assert joints.age(10 * S) == math.inf and joints.arm_stamp_ns() is None
    with pytest.raises(PortError, match="joint 'j7' is not in the joint states; is the arm's driver running"):
        joints.arm_positions(10 * S)
    joints.update(("j7", "f2"), (0.7, 0.02), 11 * S)
    assert joints.age(13 * S) == pytest.approx(3.0), "the second finger's stamp does not count"
    assert joints.arm_stamp_ns() == 10 * S
    joints.update(ARM, REST.tolist(), 12 * S)
    assert joints.age(13 * S) == pytest.approx(3.0), "the first finger's does"
    joints.update(("f1",), (0.01,), 13 * S)
    assert joints.age(13 * S) == pytest.approx(1.0)
    assert joints.age(11 * S) == pytest.approx(-1.0)


def test_the_width_is_twice_the_mean_of_the_fingers_that_were_seen() -> None:
    joints = JointTracker(ARM, FINGERS)
    with pytest.raises(PortError, match="joint 'f1' is not in the joint states"):
        joints.width(S)
    joints.update(("f2",), (0.03,), S)
    assert joints.width(S) == pytest.approx(0.06)
    joints.update(("f1", "wheel"), (0.01, 7.0), S)
    assert joints.width(S) == pytest.approx(0.04)
    with pytest.raises(PortError, match=r"'f1' is 2\.0 s old"):
        joints.width(3 * S)


def test_what_is_not_finite_or_unknown_hides_nothing_else() -> None:
    joints = JointTracker(ARM, FINGERS)
    joints.update(("wheel", *ARM, "f1"), (math.nan, *REST, math.inf), S)
    np.testing.assert_array_equal(joints.arm_positions(S), REST)
    joints.update(("j1", "j2"), (math.nan, 0.9), S)
    np.testing.assert_array_equal(joints.arm_positions(S)[:2], [0.1, 0.9])
    with pytest.raises(PortError, match="'f1' is not in"):
        joints.width(S)


def test_a_standstill_needs_two_looks_at_different_times() -> None:
    assert not tracker((S, REST)).is_still(S)
    assert not tracker((S, REST), (S, REST)).is_still(S)
    assert tracker((S, REST), (S + MS, REST)).is_still(S + MS)


def test_unchanged_counts_from_the_first_of_the_same_states() -> None:
    joints = tracker((1 * S, REST), (2 * S, REST + 1e-9), (3 * S, REST + 1e-9))
    assert joints.unchanged(5 * S) == pytest.approx(3.0)
    joints.update(("j7",), (0.0,), 4 * S)
    assert joints.unchanged(5 * S) == pytest.approx(2.0), "each joint counts; the arm is as old as its oldest joint"


def test_distrust_lasts_until_a_joint_changes() -> None:
    joints = tracker((S, REST), (S + 50 * MS, REST))
    joints.distrust()
    for step in range(2, 6):
        joints.update(ARM, REST.tolist(), S + 50 * step * MS)
        assert not joints.is_still(S + 50 * step * MS)
    changed = REST + np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1e-6])
    joints.update(ARM, changed.tolist(), S + 300 * MS)
    assert joints.is_still(S + 300 * MS)


@pytest.mark.parametrize("joint", range(7))
@pytest.mark.parametrize(("speed", "still"), [(0.0199, True), (0.0201, False), (-0.0199, True), (-0.0201, False)])
def test_each_joint_must_be_slow(joint: int, speed: float, still: bool) -> None:
    step = np.zeros(7)
    step[joint] = speed * 0.02
    joints = tracker(*((S + 20 * i * MS, REST + i * step) for i in range(5)))
    assert joints.is_still(S + 80 * MS) is still


@pytest.mark.parametrize(("jump_ms", "still"), [(79, False), (80, False), (81, True)])
def test_what_moved_more_than_80_ms_ago_does_not_count(jump_ms: int, still: bool) -> None:
    newest = S + 200 * MS
    before, after = REST + 1.0, REST
    joints = tracker((newest - jump_ms * MS, before), (newest - 40 * MS, after), (newest, after))
    assert joints.is_still(newest) is still


def test_a_clock_that_was_set_back_leaves_nothing_of_the_time_before() -> None:
    joints = tracker((100 * S, REST), (100 * S + 50 * MS, REST), (5 * S, REST))
    assert not joints.is_still(5 * S), "one look since"
    joints.update(ARM, REST.tolist(), 5 * S + 50 * MS)
    assert joints.is_still(5 * S + 50 * MS)


def test_a_clock_that_was_set_back_a_little_is_followed_too() -> None:
    """To a time that lies among the looks that are kept."""
    joints = tracker(*((10 * S + 100 * i * MS, REST) for i in range(11)))
    for now in (10 * S + 500 * MS, 10 * S + 550 * MS):
        joints.update(ARM, REST.tolist(), now)
    assert joints.is_still(10 * S + 550 * MS)


def plainly_still(track: list[tuple[int, FloatArray]]) -> bool:
    """Say whether the looks of the last 80 ms, the last two at least, keep below 0.02 rad/s over their time."""
    newest = track[-1][0]
    recent = [look for i, look in enumerate(track) if newest - look[0] <= 80 * MS or i >= len(track) - 2]
    span = (newest - recent[0][0]) / S
    return all(
        max(look[1][joint] for look in recent) - min(look[1][joint] for look in recent) <= 0.02 * span
        for joint in range(7)
    )


def test_it_agrees_with_a_plain_judgement() -> None:
    random = np.random.default_rng(4)
    told = []
    for _ in range(300):
        stamps = S + np.cumsum(random.integers(5, 60, size=int(random.integers(2, 12)))) * MS
        speed = random.uniform(0.2, 1.8) * 0.02
        ways = speed * (stamps - S) / S + random.normal(0.0, 2e-5, len(stamps))
        track = [(int(stamp), REST + way * random.uniform(0.9, 1.0, 7)) for stamp, way in zip(stamps, ways)]
        joints = tracker(*track)
        told.append(joints.is_still(track[-1][0]))
        assert told[-1] == plainly_still(track)
    assert 50 < sum(told) < 250, "both answers come up"
