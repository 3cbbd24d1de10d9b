"""Shapes under names that no demonstration holds: piece and hole alike, and only where the name is not what tells."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cliport_policy.config import TrainConfig
from cliport_policy.data.batches import Phrasebook, make_sample
from cliport_policy.data.demonstrations import Demonstration, load_demonstrations
from cliport_policy.data.mixture import Drawn
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


@pytest.mark.parametrize(("share", "strange"), [(0.0, False), (1.0, True)])
def test_training_says_them_in_so_many_samples(
    share: float, strange: bool, make_flat_set: Callable[..., Path], tmp_path: Path
) -> None:
    data = load_demonstrations(make_flat_set(tmp_path / "data", 1))
    drawn = Drawn(data, data.frames[0], replace(data.frames[0].demos[0], instruction=KIT), None)
    config = TrainConfig(jitter=False, augment_probability=0.0, strange_share=share)
    book = Phrasebook({KIT: 0}, np.random.default_rng(0))
    phrases = {make_sample(drawn, book, None, config, np.random.default_rng(seed)).phrase for seed in range(9)}
    assert (phrases == {KIT}) != strange and all(phrase.startswith("put the red ") for phrase in phrases)
