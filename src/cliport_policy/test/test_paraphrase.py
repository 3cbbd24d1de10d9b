"""The training grammar keeps the meaning, and never says what the evaluation says."""

import re
from pathlib import Path

import numpy as np
import pytest

from cliport_policy.data.batches import Phrasebook
from cliport_policy.data.paraphrase import paraphrase, parse_canonical
from cliport_policy.data.phrasings import says_all

CANONICAL = "put the green blocks in a yellow bowl"


def test_colors_survive_in_every_wording() -> None:
    rng = np.random.default_rng(0)
    for _ in range(2000):
        words = re.findall(r"[a-z]+", paraphrase(CANONICAL, rng).lower())
        assert "green" in words and "yellow" in words


def test_canonical_sentence_is_read_and_others_are_left_alone() -> None:
    assert parse_canonical(CANONICAL) == ("green", "yellow")
    assert parse_canonical("pack the square in the brown box") is None
    other = "fold the towel"
    assert paraphrase(other, np.random.default_rng(0)) == other


@pytest.mark.parametrize(
    ("sentence", "kept"),
    [
        ("pack all the red and blue blocks into the brown box", ("red", "blue")),
        ("pack all the toy train objects in the brown box", ("toy train",)),
        ("pack the letter V shape in the brown box", ("letter v shape",)),
        ("put the blue block on the red and green blocks", ("blue", "red and green blocks")),
        ("put the gray star in the top star hole", ("gray", "top")),
        ("push the pile of red blocks into the blue square", ("red", "blue")),
        ("move the red ring to the lighter brown side", ("red", "lighter brown side")),
        ("align the rope from front left tip to back left corner", ("front left tip", "back left corner")),
    ],
)
def test_every_task_has_twenty_wordings_that_keep_what_is_named(sentence: str, kept: tuple[str, ...]) -> None:
    rng = np.random.default_rng(0)
    found = {paraphrase(sentence, rng).lower() for _ in range(600)}
    assert all(word in wording for wording in found for word in kept)
    assert not any("{" in wording for wording in found)
    assert len(found) > 100
    assert sentence.lower() in found


def test_half_the_wordings_of_kits_say_a_colour_and_leave_the_shape_to_what_fits() -> None:
    for side in ("", "top "):
        sentence = f"put the gray letter M shape in the {side}letter M shape hole"
        book = Phrasebook({sentence: 400}, np.random.default_rng(0))
        phrases = book.all_phrases()
        vague = [phrase for phrase in phrases if "letter m" not in phrase.lower()]
        assert 0.35 < len(vague) / len(phrases) < 0.65
        assert all("gray" in phrase.lower() and ("top" in phrase.lower()) is bool(side) for phrase in phrases)
        assert [phrase for phrase in phrases if not says_all(phrase, sentence)] == vague
        rng = np.random.default_rng(1)
        assert any(book.draw(sentence, rng) in vague for _ in range(40))
        assert not any(book.draw(sentence, rng, whole=True) in vague for _ in range(200))
    assert says_all("fold it", "fold the towel"), "a sentence of no task"
    assert not says_all("Bring the red piece into its hole", "put the red ring in the ring hole"), "no ring is named"


def test_evaluation_wordings_never_occur_in_training() -> None:
    source = Path(__file__).resolve().parents[2] / "cliport_benchmark/cliport_benchmark/phrasings"
    if not source.is_dir():
        pytest.skip("the benchmark package is not beside this one")
    lines = (source / "put-blocks-in-bowls.txt").read_text().splitlines()
    held_out = {_plain(s.format(block="green", bowl="yellow")) for s in lines if s and not s.startswith("#")}
    assert len(held_out) >= 30
    rng = np.random.default_rng(1)
    trained = {_plain(paraphrase(CANONICAL, rng)) for _ in range(20000)}
    assert not held_out & trained


def _plain(sentence: str) -> str:
    return " ".join(re.findall(r"[a-z]+", sentence.lower()))
