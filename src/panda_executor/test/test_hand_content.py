"""What the hand is known to hold, after any end of the fingers' motion."""

from __future__ import annotations

import pytest

from panda_executor.errors import RequestError
from panda_executor.hand_content import HandContent
from panda_executor.hand_geometry import HandShape
from panda_model import load_preset


@pytest.fixture
def hand() -> HandContent:
    return HandContent(0.005)


def test_the_width_tells_what_the_hand_holds(hand: HandContent) -> None:
    assert not hand.holds(0.04)
    hand.note(0.0, 0.04)
    assert hand.holds(0.041) and not hand.holds(0.05)  # someone else opened it
    hand.note(0.0, 0.003)
    assert not hand.holds(0.003)
    hand.note(0.06, 0.06)
    assert not hand.holds(0.06)


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
