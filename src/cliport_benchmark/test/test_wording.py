"""Sentences in other words: patterns in turn, colours by other names, and files that say nothing of use."""

from dataclasses import replace
from pathlib import Path

import pytest

from cliport_benchmark.errors import OptionError
from cliport_benchmark.wording import Wording, load_patterns, load_synonyms
from cliport_policy.data.strange_words import STRANGE_NAMES, STRANGE_OBJECTS
from sim_bridge.everyday import catalogue, google_names
from sim_bridge.objects.kit_shapes import KIT_SHAPES
from sim_bridge.tasks import ColorGoal
from sim_bridge.tasks.color_goal import PATTERN


def test_wording_fills_patterns_in_turn_and_swaps_words(tmp_path: Path) -> None:
    patterns = tmp_path / "patterns.txt"
    patterns.write_text("# new\n\nevery {block} cube into the {bowl} dish\n{bowl} bowl: {block} blocks\n")
    synonyms = tmp_path / "synonyms.txt"
    synonyms.write_text("red = crimson\n")
    wording = Wording(load_patterns(patterns, PATTERN), load_synonyms(synonyms))
    slots = {"block": "red", "bowl": "green"}
    assert wording.sentence(PATTERN, slots, 0) == "every crimson cube into the green dish"
    assert wording.sentence(PATTERN, slots, 3) == "green bowl: crimson blocks"
    assert replace(wording, patterns=()).sentence(PATTERN, slots, 0) == "put the crimson blocks in a green bowl"
    assert Wording().sentence(PATTERN, slots, 5) == ColorGoal("red", "green").sentence
    patterns.write_text("fine {block} {bowl}\nput {block} away\n")
    with pytest.raises(OptionError, match=r"line 2: the pattern lacks \{bowl\}"):
        load_patterns(patterns, PATTERN)
    synonyms.write_text("mauve = purple\n")
    with pytest.raises(OptionError, match="line 1: write 'colour = word'"):
        load_synonyms(synonyms)


def test_colours_within_a_slot_are_said_otherwise_too() -> None:
    wording = Wording(synonyms={"blue": "azure", "red": "blue"})
    slots = {"color": "green", "place": "the blue and red blocks"}
    said = wording.sentence("put the {color} block on {place}", slots, 0)
    assert said == "put the green block on the azure and blue blocks"


def test_no_strange_name_is_one_of_the_benchmarks() -> None:
    """What training calls shapes by strange names never says a held-out one."""
    words = {word for shape in KIT_SHAPES for word in shape.name.split()} - {"letter", "shape"}
    assert len(STRANGE_NAMES) > 50 and not any(word in name.split() for name in STRANGE_NAMES for word in words)
    objects = {*catalogue.SEEN, *catalogue.UNSEEN, *google_names.SEEN, *google_names.UNSEEN}
    assert len(STRANGE_OBJECTS) > 80 and not objects.intersection(STRANGE_OBJECTS)
