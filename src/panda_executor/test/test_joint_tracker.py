"""What is known of the arm where its joints and the fingers come in messages of their own."""

from __future__ import annotations

import math

import numpy as np
import pytest

from panda_executor.errors import PortError
from panda_executor.joint_tracker import JointTracker

S = 1_000_000_000
STEP = S // 50
ARM = tuple(f"panda_joint{i}" for i in range(1, 8))
FINGERS = ("panda_finger_joint1", "panda_finger_joint2")


def test_the_hands_messages_are_no_news_of_the_arm() -> None:
    """The arm's driver dies on the way, the hand's goes on: nothing says that the arm rests."""
    joints = JointTracker(ARM, FINGERS)
    for step in range(10):
        joints.update(ARM, np.full(7, 0.01 * step), step * STEP)
    for step in range(10, 30):
        joints.update(FINGERS, [0.02, 0.02], step * STEP)
        assert not joints.is_still(step * STEP), step
    assert joints.arm_stamp_ns() == 9 * STEP
    assert joints.unchanged(29 * STEP) == pytest.approx(20 / 50)


def test_a_hand_whose_stamps_are_a_little_behind_hides_no_standstill() -> None:
    joints = JointTracker(ARM, FINGERS)
    for step in range(1, 10):
        joints.update(ARM, np.zeros(7), step * STEP)
        joints.update(FINGERS, [0.02, 0.02], step * STEP - STEP // 2)
    assert joints.is_still(9 * STEP)


def test_an_arm_in_two_messages_is_as_old_as_the_older() -> None:
    joints = JointTracker(ARM, FINGERS)
    joints.update(ARM[:4], np.zeros(4), 10 * STEP)
    assert joints.arm_stamp_ns() is None
    joints.update(ARM[4:], np.zeros(3), 11 * STEP)
    assert joints.arm_stamp_ns() == 10 * STEP


def test_the_newest_position_counts_whatever_order_they_come_in() -> None:
    joints = JointTracker(ARM, FINGERS)
    joints.update(ARM, np.full(7, 0.2), 11 * STEP)
    joints.update(ARM, np.full(7, 0.1), 10 * STEP)
    np.testing.assert_array_equal(joints.arm_positions(11 * STEP), np.full(7, 0.2))


def test_positions_after_a_clock_was_set_back_are_taken() -> None:
    joints = JointTracker(ARM, FINGERS)
    joints.update(ARM, np.full(7, 0.2), 100 * S)
    with pytest.raises(PortError, match="ahead of the clock"):
        joints.arm_positions(5 * S)
    joints.update(ARM, np.full(7, 0.1), 5 * S)
    np.testing.assert_array_equal(joints.arm_positions(5 * S), np.full(7, 0.1))


def test_values_that_are_stamped_anew_are_told_from_new_ones() -> None:
    joints = JointTracker(ARM, FINGERS)
    assert joints.unchanged(0) == math.inf
    for step in range(50):
        joints.update(ARM, np.full(7, min(step, 10) * 0.01), step * S // 50)
    assert joints.unchanged(49 * S // 50) == pytest.approx(39 / 50)
    assert joints.is_still(49 * S // 50)
    joints.distrust()
    assert not joints.is_still(49 * S // 50), "an arm whose states froze is not known to stand still"
    joints.update(ARM, np.full(7, 0.1001), S)
    assert joints.is_still(S)


def test_a_clock_that_is_set_back_begins_anew() -> None:
    joints = JointTracker(ARM, FINGERS)
    for step in (*range(100, 110), *range(10)):
        joints.update(ARM, np.zeros(7), step * S // 50)
    assert joints.is_still(9 * S // 50)


@pytest.mark.parametrize("jump", [10 * S, -10 * S])
def test_an_arm_that_moves_is_not_at_rest_when_the_clock_jumps(jump: int) -> None:
    """Its way from before the jump to after it is short for so long a time."""
    joints = JointTracker(ARM, FINGERS)
    for step in range(20):
        stamp = 20 * S + step * STEP + (jump if step >= 10 else 0)
        joints.update(ARM, np.full(7, 0.01 * step), stamp)
        assert not joints.is_still(stamp), step
