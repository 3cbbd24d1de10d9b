"""What the hand is known to hold, after any end of the fingers' motion."""

from __future__ import annotations

import pytest

from cliport_core.outcome import Refusal
from panda_executor.errors import RequestError
from panda_executor.hand_content import HandContent
from panda_executor.hand_geometry import HandShape
from panda_model import load_preset


@pytest.fixture
def hand() -> HandContent:
    """A hand that was first measured open."""
    hand = HandContent(0.005, 0.08)
    assert not hand.holds(0.08)
    return hand


def test_the_width_tells_what_the_hand_holds(hand: HandContent) -> None:
    assert not hand.holds(0.04)
    hand.note(0.0, 0.04)
    assert hand.holds(0.041) and not hand.holds(0.05)  # someone else opened it
    hand.note(0.0, 0.003)
    assert not hand.holds(0.003)
    hand.note(0.06, 0.06)
    assert not hand.holds(0.06)


@pytest.mark.parametrize(
    ("width", "holds"), [(0.0, False), (0.0049, False), (0.005, True), (0.04, True), (0.0749, True), (0.0751, False)]
)
def test_what_the_fingers_held_before_the_start_is_not_dropped(width: float, holds: bool) -> None:
    """An executor that was killed while it carried something, and started again, finds the fingers round it."""
    hand = HandContent(0.005, 0.08)
    assert hand.holds(width) is hand.holds(width) is holds
    assert hand.load(width) is None, "its shape is unknown"
    if not holds:
        hand.check_empty(width)
        assert not hand.holds(0.04), "only the first measured width tells"
        return
    with pytest.raises(RequestError, match=r"mm apart when the executor started.*call \S+open to let it go") as caught:
        hand.check_empty(width)
    assert (caught.value.refusal, caught.value.value) == (Refusal.HAND_NOT_EMPTY, width)
    assert hand.has_lost(width + 0.0031) and not hand.holds(width + 0.0031), "somebody opened it"
    hand.begin(0.08)
    hand.note(0.08, 0.08)
    hand.check_empty(width)


def test_what_is_grasped_after_the_start_is_told_apart_from_what_was_held_before() -> None:
    hand = HandContent(0.005, 0.08)
    assert hand.holds(0.04)
    hand.begin(0.0)
    hand.note(0.0, 0.03)
    with pytest.raises(RequestError, match="the hand still holds something 30 mm wide"):
        hand.check_empty(0.03)


def test_an_opening_that_did_not_happen_lets_nothing_go(hand: HandContent) -> None:
    hand.note(0.0, 0.04)
    hand.begin(0.08)
    assert hand.holds(0.04)
    assert not hand.holds(0.06)  # it did happen, whatever was said of it


def test_fingers_that_closed_and_were_not_seen_since_may_hold_something(hand: HandContent) -> None:
    hand.begin(0.0)
    with pytest.raises(RequestError, match="still holds something 40 mm wide"):
        hand.check_empty(0.04)
    assert not hand.holds(0.001)


def test_the_shape_is_that_of_what_is_held(hand: HandContent) -> None:
    shape = HandShape(load_preset().hand, 0.04)
    hand.begin(0.0, shape)
    hand.note(0.0, 0.04)
    assert hand.load(0.04) is shape
    hand.begin(0.08)
    assert hand.load(0.04) is shape
    hand.note(0.08, 0.08)
    assert hand.load(0.08) is None
    hand.begin(0.0)
    hand.note(0.0, 0.03)
    assert hand.load(0.03) is None, "another thing, of unknown shape"


def test_fingers_that_stop_at_a_width_hold_something_from_that_width_on(hand: HandContent) -> None:
    """5 mm and more is something; 5 mm asked for and reached is not: the fingers were not told to close on it."""
    for commanded, width, holds in (
        (0.0, 0.005, True),
        (0.0, 0.0049, False),
        (0.0049, 0.02, True),
        (0.005, 0.02, False),
        (0.005, 0.005, False),
    ):
        hand.note(commanded, width)
        assert hand.holds(width) == holds, (commanded, width)


@pytest.mark.parametrize("change", [-1.0, 1.0])
def test_fingers_that_moved_by_three_millimetres_hold_it_no_more(hand: HandContent, change: float) -> None:
    hand.note(0.0, 0.04)
    assert hand.holds(0.04 + change * 0.0029) and not hand.holds(0.04 + change * 0.0031)


def test_closing_fingers_hold_what_stops_them_from_the_least_width_on(hand: HandContent) -> None:
    hand.begin(0.0049)
    assert hand.holds(0.005) and not hand.holds(0.0049)
    hand.note(0.0, 0.03)
    hand.begin(0.005)
    assert hand.holds(0.03) and not hand.holds(0.05), "told to open, it holds what it held, and nothing else"


def test_a_full_hand_is_refused_with_its_width_and_how_to_empty_it(hand: HandContent) -> None:
    hand.check_empty(0.04)
    hand.note(0.0, 0.0416)
    with pytest.raises(
        RequestError, match=r"holds something 42 mm wide; call \S+recover to carry .*, \S+open"
    ) as caught:
        hand.check_empty(0.0416)
    assert (caught.value.refusal, caught.value.value, caught.value.limit) == (Refusal.HAND_NOT_EMPTY, 0.0416, 0.005)
    hand.check_empty(0.05)
    hand.note(0.08, 0.08)
    hand.check_empty(0.0416)


@pytest.mark.parametrize(
    ("width", "lost"), [(0.0049, True), (0.005, False), (0.02, False), (0.0429, False), (0.0431, True), (0.08, True)]
)
def test_what_is_held_is_lost_when_the_fingers_close_or_open_and_not_when_it_gives_way(
    hand: HandContent, width: float, lost: bool
) -> None:
    hand.note(0.0, 0.04)
    assert hand.has_lost(width) is lost


def test_of_what_was_never_held_it_is_only_known_when_there_is_nothing(hand: HandContent) -> None:
    assert not hand.has_lost(0.08) and hand.has_lost(0.0049)
