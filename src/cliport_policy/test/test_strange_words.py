"""Shapes under names that no demonstration holds: piece and hole alike, and only where the name is not what tells."""

import numpy as np
import pytest

from cliport_policy.data.demonstrations import Demonstration
from cliport_policy.data.strange_words import STRANGE_NAMES, strange_words

KIT = "put the red star in the top star hole"
THINGS = {("red", "star"), ("blue", "plus"), ("", "star hole"), ("", "plus hole")}


def _said(sentence: str, phrase: str, absent: bool = False) -> str:
    demo = Demonstration(sentence, False, (1, 1), 0.0, 3.0, (2, 2), 0.0, absent=absent)
    return strange_words(phrase, demo, THINGS, np.random.default_rng(0))


def test_piece_and_hole_have_the_same_strange_name() -> None:
    said = _said(KIT, "the red star belongs into the top star hole, not the starry one")
    head, between, end = said.removeprefix("the red ").partition(" belongs into the top ")
    assert head in STRANGE_NAMES and between and end == f"{head} hole, not the starry one"
    names = {
        strange_words(KIT, Demonstration(KIT, False, (1, 1), 0.0, 3.0, (2, 2), 0.0), THINGS, np.random.default_rng(i))
        for i in range(40)
    }
    assert len(names) > 20


@pytest.mark.parametrize(
    ("sentence", "phrase", "absent"),
    [
        ("put the red blocks in a blue bowl", "put the red blocks in a blue bowl", False),
        ("pack the star in the brown box", "pack the star in the brown box", False),
        (KIT, "the red piece into its top hole", False),
        ("put the blue star in the star hole", "put the blue star in the star hole", True),  # something blue is there
        ("no sentence of the benchmark", "whatever", False),
    ],
)
def test_other_wordings_stay_as_they_are(sentence: str, phrase: str, absent: bool) -> None:
    assert _said(sentence, phrase, absent) == phrase


def test_a_piece_whose_colour_is_missing_may_have_any_name() -> None:
    assert "star" not in _said("put the gray star in the star hole", "put the gray star in the star hole", absent=True)
