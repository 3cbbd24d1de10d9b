"""Sentences in which all colours are alike: a thing's colour makes no sentence unlike those that were trained."""

from dataclasses import replace

import pytest

from cliport_policy.data.color_names import color_spans
from cliport_policy.errors import InstructionError
from cliport_policy.joint_config import JointConfig
from cliport_policy.named_colors import with_colors_alike
from cliport_policy.policy import Policy

HEART = "put the {} heart in the heart hole"


@pytest.mark.parametrize(
    ("sentence", "names"),
    [
        ("put the red brick in a green bowl", ["red", "green"]),
        ("the red brick should go in the brick bowl", ["red", "brick"]),
        ("pack the blue toy brick into the brown box", ["blue", "brown"]),
        ("move a brick red block onto the brick", ["brick red"]),
        ("put the Leaf cube in the leaf hole", ["Leaf"]),
        ("pack all the teal and salmon blocks into the brown box", ["teal", "salmon", "brown"]),
        ("put the cube in teal in a bowl that is plum", ["teal", "plum"]),
    ],
)
def test_what_is_a_thing_is_no_colour(sentence: str, names: list[str]) -> None:
    assert [sentence[start:end] for start, end in color_spans(sentence)] == names


def test_names_of_colours_become_one_word() -> None:
    assert with_colors_alike("put the dusty purple ring on a Red peg") == "put the colored ring on a colored peg"
    assert with_colors_alike("put the ring there") == "put the ring there"


@pytest.mark.parametrize("color", ["purple", "white", "dusty pink"])
def test_no_colour_makes_a_sentence_unlike_the_trained_ones(policy: Policy, color: str) -> None:
    policy.check_instruction(HEART.format(color))


def test_a_network_that_reads_tokens_is_asked_for_its_own_words_alone(policy: Policy) -> None:
    network = policy.card.network
    assert isinstance(network, JointConfig) and network.color_reading == "names"
    card = replace(policy.card, network=replace(network, color_reading="tokens"))
    tokens = Policy(policy._network, policy._anchors, card, policy._encoder)
    assert tokens.similarity(HEART.format("purple")) < policy.similarity(HEART.format("purple"))
    with pytest.raises(InstructionError, match="is unlike anything"):
        tokens.check_instruction(HEART.format("purple"))


@pytest.mark.parametrize("words", ["the quick brown fox", "buy a red car", "drive the blue car to work"])
def test_a_colour_makes_no_sentence_likely(policy: Policy, words: str) -> None:
    with pytest.raises(InstructionError, match="is unlike anything"):
        policy.check_instruction(words)
