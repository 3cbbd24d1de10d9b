"""A tour of the hand: when it goes on, what it says, and when it gives up."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from cliport_core.outcome import ActionResult, Outcome, Refusal
from cliport_core.pose import Pose
from cliport_perception.calibration.tour import Tour, TourConfig
from cliport_perception.errors import CalibrationError

FIRST = Pose(np.eye(3), np.array([0.4, 0.0, 0.5]))
DONE = ActionResult(Outcome.SUCCEEDED, "the hand is there")
NO_WAY = ActionResult(Outcome.PLANNING_FAILED, "the hand would touch the table")
TOO_FAR = ActionResult(Outcome.REJECTED, "out of reach", refusal=Refusal.OUT_OF_REACH)
STOPPED = ActionResult(Outcome.REJECTED, "the executor did not take the goal: it is busy, or stopped")


class Hand:
    """A mover whose motions end at the next look, with what the test sets."""

    def __init__(self) -> None:
        self.targets: list[Pose] = []
        self.tried: list[int] = []
        self.words: list[str] = []
        self.answer: ActionResult | None = DONE

    def propose(self, tried: Sequence[Pose]) -> Pose | None:
        self.tried.append(len(tried))
        return Pose(np.eye(3), np.array([0.0, 0.0, float(len(self.targets))]))

    def start(self, target: Pose) -> None:
        self.targets.append(target)

    def end(self) -> ActionResult | None:
        return self.answer


@pytest.fixture
def hand() -> Hand:
    return Hand()


def tour_of(hand: Hand, first: Pose | None = FIRST, **config: float) -> Tour:
    return Tour(hand.propose, hand, hand.words.append, first, TourConfig(**config))  # type: ignore[arg-type]


def run(tour: Tour, period: float, count: int) -> None:
    """Let `count` ticks without a sample go by."""
    for step in range(count):
        tour.tick(period * (step + 1), 0)


def test_it_goes_on_once_a_sample_was_taken(hand: Hand) -> None:
    tour = tour_of(hand)
    tour.tick(0.0, 0)
    assert hand.targets == [FIRST]
    tour.tick(1.0, 0)  # arrived
    tour.tick(1.5, 0)
    assert len(hand.targets) == 1, "it looks first"
    tour.tick(1.6, 1)
    assert len(hand.targets) == 2
    tour.tick(2.0, 1)
    tour.tick(3.0, 1)
    assert len(hand.targets) == 2 and hand.tried == [1], "one sample, one move; told of what was tried"


def test_it_waits_for_the_end_of_a_motion(hand: Hand) -> None:
    tour = tour_of(hand)
    hand.answer = None
    for now in (0.0, 50.0, 100.0):
        tour.tick(now, 0)
    assert hand.targets == [FIRST]
    hand.answer = DONE
    tour.tick(101.0, 0)
    tour.tick(106.9, 0)
    assert hand.targets == [FIRST], "six seconds from its arrival"
    tour.tick(107.1, 0)
    assert len(hand.targets) == 2


def test_without_a_first_pose_it_looks_from_where_the_hand_is(hand: Hand) -> None:
    tour = tour_of(hand, first=None)
    tour.tick(10.0, 0)
    tour.tick(15.9, 0)
    assert hand.targets == []
    tour.tick(16.1, 0)
    assert len(hand.targets) == 1


def test_nothing_moves_while_it_is_not_known_where_the_gripper_is(hand: Hand) -> None:
    tour = Tour(lambda tried: None, hand, hand.words.append, config=TourConfig(most_fruitless=2))
    run(tour, 0.1, 1000)
    assert hand.targets == [] and set(hand.words) == {
        "where the gripper is is not known: does /tf join it to the base, and do transforms come?"
    }
    assert 18 <= len(hand.words) <= 20, "each five seconds, and it never gives up"


@pytest.mark.parametrize("refusal", [NO_WAY, TOO_FAR])
def test_a_pose_that_cannot_be_reached_is_left_for_another_at_once(hand: Hand, refusal: ActionResult) -> None:
    tour = tour_of(hand, most_refused=3)
    hand.answer = refusal
    tour.tick(0.0, 0)
    with pytest.raises(CalibrationError, match="4 poses in a row cannot be reached.*" + refusal.message):
        run(tour, 0.01, 20)
    assert len(hand.targets) == 4 and hand.words == []


def test_a_pose_that_is_reached_ends_the_row_of_those_that_are_not(hand: Hand) -> None:
    tour = tour_of(hand, most_refused=2)
    now, samples = 0.0, 0
    tour.tick(now, 0)
    for _ in range(4):
        for answer in (NO_WAY, NO_WAY, DONE):
            hand.answer = answer
            tour.tick(now, samples)
            samples += answer is DONE
            now += 1.0
            tour.tick(now, samples)
    assert len(hand.targets) == 13


def test_poses_without_a_sample_end_it(hand: Hand) -> None:
    tour = tour_of(hand, most_fruitless=2, look_s=1.0)
    with pytest.raises(CalibrationError, match=r"no sample at 3 poses in a row.*--first"):
        run(tour, 0.4, 100)
    assert len(hand.targets) == 3


def test_a_sample_ends_the_row_of_poses_without_one(hand: Hand) -> None:
    tour = tour_of(hand, most_fruitless=2, look_s=1.0)
    for step in range(100):
        tour.tick(0.4 * step, step // 7)
    assert len(hand.targets) > 10


def test_a_stop_is_said_and_waited_for(hand: Hand) -> None:
    tour = tour_of(hand, again_s=5.0, most_fruitless=2)
    hand.answer = STOPPED
    for step in range(1001):
        tour.tick(0.1 * step, 0)
    assert 19 <= len(hand.targets) <= 21, "each five seconds, and it never gives up"
    assert hand.words[0] == (
        "the hand does not move to (0.400, 0.000, 0.500) m, roll, pitch, yaw (0.00, 0.00, 0.00) rad: the executor did "
        "not take the goal: it is busy, or stopped"
    )
