"""Words for sides: which sentences name one for the place, and which of several places that are alike is meant."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from cliport_core.heightmap import Heightmap
from cliport_policy.joint_config import JointConfig
from cliport_policy.policy import Policy, load_policy
from cliport_policy.sides import Side, at_side, side_named


@pytest.mark.parametrize(
    ("sentence", "side"),
    [
        ("put the red heart in the left heart hole", Side.LEFT),
        ("Cover the TOP heart hole with the yellow heart", Side.TOP),
        ("put the cyan one into its lower hole", Side.BOTTOM),
        ("the right letter M shape hole still lacks its red one", Side.RIGHT),
        ("park the red star in the middle star hole", Side.MIDDLE),
        ("put the blue block in the bowl on the left.", Side.LEFT),
        ("put the green block on the middle brown block", None),  # a shade
        ("move the red ring to the middle of the stand", None),
        ("put the red block on top of the blue block", None),
        ("move the ring to the right side", None),
        ("align the rope from the front left tip to the back right corner", None),
        ("go right ahead and put the red block in the blue bowl", None),
        ("put the left block in the right bowl", None),  # which of them is the place's is not known
        ("", None),
    ],
)
def test_a_sentence_names_the_side_of_its_place(sentence: str, side: Side | None) -> None:
    assert side_named(sentence) is side


def test_top_is_towards_the_robot_and_left_towards_minus_y() -> None:
    pixels = [(50, 60), (10, 70), (50, 90), (90, 75), (52, 76)]  # (row, col)
    found = {side: pixels[at_side(side, pixels)] for side in Side}
    assert found == {
        Side.TOP: (50, 60), Side.LEFT: (10, 70), Side.BOTTOM: (50, 90), Side.RIGHT: (90, 75), Side.MIDDLE: (52, 76),
    }  # fmt: skip
    assert at_side(Side.RIGHT, pixels[:1]) == 0


@pytest.fixture(scope="module")
def policy() -> Policy:
    return load_policy("default")


def places_with(policy: Policy, heights: dict[tuple[int, int], float]) -> torch.Tensor:
    """Return logits (1, 2, h, w) with peaks of those logits at cells, all under the second rotation."""
    logits = torch.zeros(1, 2, *policy.grid.shape)
    for cell, height in heights.items():
        logits[(0, 1, *cell)] = height
    return logits


@pytest.mark.parametrize(
    ("side", "heights", "expected"),
    [
        (Side.LEFT, {(20, 40): 20.0, (60, 40): 21.0}, (20, 40)),
        (Side.RIGHT, {(20, 40): 21.0, (60, 40): 20.0}, (60, 40)),
        (Side.LEFT, {(20, 40): 19.0, (60, 40): 21.0}, (60, 40)),  # 0.13 as likely: not alike
        (Side.MIDDLE, {(20, 40): 20.0, (60, 40): 20.0, (100, 40): 20.9}, (60, 40)),
        (Side.MIDDLE, {(20, 40): 20.0, (60, 40): 20.5}, (60, 40)),  # there is no middle of two
    ],
)
def test_of_places_that_are_alike_the_one_at_the_side_is_left(
    policy: Policy, side: Side, heights: dict[tuple[int, int], float], expected: tuple[int, int]
) -> None:
    places = policy._at_side(side, places_with(policy, heights))
    assert np.unravel_index(int(places.argmax()), places.shape)[2:] == expected
    kept = places[(0, 1, *expected)] - heights[expected]
    assert float(kept) == 0.0


def test_only_a_policy_that_reads_sides_hears_them(policy: Policy, monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[Side] = []
    monkeypatch.setattr(Policy, "_at_side", lambda self, side, places: asked.append(side) or places)
    network = policy.card.network
    assert isinstance(network, JointConfig) and network.reads_sides
    without = Policy(
        policy._network, policy._anchors, replace(policy.card, network=replace(network, reads_sides=False)),
        policy._encoder,
    )  # fmt: skip
    for one in (policy, without):
        one._score(_empty(one), "put the red heart in the left heart hole", None)
        one._score(_empty(one), "put the red heart in the heart hole", None)
    assert asked == [Side.LEFT]


def _empty(policy: Policy) -> Heightmap:
    shape = policy.workspace.shape
    color, height = np.full((*shape, 3), 128, np.uint8), np.zeros(shape, np.float32)
    return Heightmap(color, height, np.ones(shape, bool), policy.workspace)
