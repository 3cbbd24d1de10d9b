"""Words for sides: which sentences name one for the place, and which of several places that are alike is meant."""

import math
from dataclasses import replace

import numpy as np
import pytest
import torch

from cliport_core.heightmap import Heightmap
from cliport_policy.joint_config import JointConfig
from cliport_policy.places import Places
from cliport_policy.policy import Policy
from cliport_policy.sides import OwnSide, Side, at_own_side, at_side, own_side_named, side_named


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
        ("put the left block in the right bowl", Side.RIGHT),
        ("i want you to put the left red block in a green bowl", None),  # the thing's side
        ("into the left hole goes the heart", Side.LEFT),
        ("use the left bowl to hold the red block", Side.LEFT),
        ("fill the left hole in the kit with the heart", Side.LEFT),
        ("fill the bowl with the left block", None),
        ("align the red piece with the bottom hole of its shape, thanks", Side.BOTTOM),
        ("into a green bowl put the left block", None),
        ("with the red heart fill the left heart hole", Side.LEFT),
        ("in the left hole put the heart", Side.LEFT),
        ("put the heart in the left or the right hole", None),
        ("", None),
    ],
)
def test_a_sentence_names_the_side_of_its_place(sentence: str, side: Side | None) -> None:
    assert side_named(sentence) is side


def test_top_is_towards_the_robot_and_left_towards_minus_y() -> None:
    pixels = [(50, 60), (10, 70), (50, 90), (90, 75), (52, 76)]  # (row, col)
    found = {side: pixels[index] for side in Side if (index := at_side(side, pixels)) is not None}
    assert found == {
        Side.TOP: (50, 60), Side.LEFT: (10, 70), Side.BOTTOM: (50, 90), Side.RIGHT: (90, 75), Side.MIDDLE: (52, 76),
    }  # fmt: skip
    assert at_side(Side.RIGHT, pixels[:1]) == 0


def test_the_middle_is_what_no_other_side_is_and_between_what_is_taken_too() -> None:
    pixels = [(40, 36), (75, 68), (70, 40), (48, 99)]  # left, right, and two of neither
    assert at_side(Side.MIDDLE, pixels) == 2, "the left one is nearer to their mean"
    assert at_side(Side.MIDDLE, pixels[:2]) is None and at_side(Side.LEFT, pixels[:2]) == 0
    assert at_side(Side.MIDDLE, [(80, 50), (45, 52)], taken=[(10, 50)]) == 1
    assert at_side(Side.MIDDLE, [(45, 50)], taken=[(80, 50)]) is None
    assert at_side(Side.MIDDLE, [(80, 50), (10, 52)], taken=[(45, 50)]) == 0, "all are at a side: next to the mean"
    assert at_side(Side.LEFT, [(80, 50), (45, 52)], taken=[(10, 50)]) == 1, "what is taken is not meant"


@pytest.mark.parametrize(
    ("sentence", "side", "front"),
    [
        ("align the rope from front left tip to back left corner", Side.LEFT, "align the rope from {} to {}"),
        ("What we need from back right corner to  front right tip is the rope", Side.RIGHT,
         "what we need from {} to {} is the rope"),
    ],
)  # fmt: skip
def test_a_sentence_names_one_side_of_a_thing_s_own(sentence: str, side: Side, front: str) -> None:
    assert own_side_named(sentence) == OwnSide(
        side,
        front.format("front left tip", "front right tip"),
        front.format("back right corner", "back left corner"),
    )


@pytest.mark.parametrize(
    "sentence",
    [
        "align the rope from front left tip to front right tip",  # both
        "align the rope from back right corner to back left corner",
        "put the rope at the front left tip",
        "put the red heart in the left heart hole",
        "put the block from the front left corner to the back left corner",  # of the table
        "",
    ],
)
def test_other_sentences_name_none(sentence: str) -> None:
    assert own_side_named(sentence) is None


def test_left_is_at_the_left_hand_of_who_looks_to_the_front() -> None:
    square = {"front left": (-1, 1), "front right": (1, 1), "back left": (-1, -1), "back right": (1, -1)}  # front is +y
    for angle in (0.0, 0.7, 2.0, 4.0):
        turn = complex(math.cos(angle), math.sin(angle))
        turned = {name: turn * complex(*at) + (0.4 - 0.1j) for name, at in square.items()}
        corners = {name: (at.real, at.imag) for name, at in turned.items()}
        front, back = ([corners[f"{end} left"], corners[f"{end} right"]] for end in ("front", "back"))
        for side in (Side.LEFT, Side.RIGHT):
            found = at_own_side(side, front, back, list(corners.values()))
            assert [list(corners)[index] for index in found] == [f"front {side.value}", f"back {side.value}"]
        one_seen = at_own_side(Side.LEFT, front[:1], back, [corners["back left"], corners["back right"]])
        assert one_seen == [0], "also where one end of the front is not seen"
        assert not at_own_side(Side.LEFT, front, back, [corners["back right"]])


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
    places = policy._places.at_side(side, places_with(policy, heights))
    assert np.unravel_index(int(places.argmax()), places.shape)[2:] == expected
    kept = places[(0, 1, *expected)] - heights[expected]
    assert float(kept) == 0.0


def test_only_a_policy_that_reads_sides_hears_them(policy: Policy, monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[Side] = []
    monkeypatch.setattr(Places, "at_side", lambda self, side, places: asked.append(side) or places)
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


def test_the_likeliest_place_at_a_thing_s_own_side_is_left(policy: Policy) -> None:
    def logits(heights: dict[tuple[int, int], float]) -> torch.Tensor:
        return places_with(policy, heights)[0]

    front, back = logits({(60, 60): 20.0, (100, 60): 20.5}), logits({(60, 20): 20.0, (100, 20): 20.0})
    places = logits({(100, 20): 21.0, (60, 20): 19.0, (60, 60): 18.0})  # the front is at +x: its left at +y
    for side, expected in ((Side.LEFT, (100, 20)), (Side.RIGHT, (60, 20))):
        kept = policy._places.at_own_side(side, front, back, places)
        assert np.unravel_index(int(kept.argmax()), kept.shape)[1:] == expected
    only = logits({(100, 20): 21.0})
    assert torch.equal(policy._places.at_own_side(Side.RIGHT, front, back, only), only)


def test_a_policy_asks_itself_about_front_and_back_where_one_of_the_own_sides_is_named(
    policy: Policy, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[tuple[Side, torch.Tensor, torch.Tensor]] = []

    def noted(self: Places, side: Side, front: torch.Tensor, back: torch.Tensor, places: torch.Tensor) -> torch.Tensor:
        asked.append((side, front, back))
        return places

    monkeypatch.setattr(Places, "at_own_side", noted)
    color = np.random.default_rng(0).integers(0, 255, (*policy.workspace.shape, 3), np.uint8)
    height = np.zeros(policy.workspace.shape, np.float32)
    scene = Heightmap(color, height, np.ones(height.shape, bool), policy.workspace)
    left, front, back = (
        f"align the rope from {words}"
        for words in (
            "front left tip to back left corner",
            "front left tip to front right tip",
            "back right corner to back left corner",
        )
    )
    policy.infer(scene, left)
    ((side, about_front, about_back),) = asked
    assert side is Side.LEFT
    assert torch.allclose(about_front, policy.score(scene, front).places)
    assert torch.allclose(about_back, policy.score(scene, back).places)
    assert not torch.allclose(about_front, about_back) and len(asked) == 1
    network = policy.card.network
    assert isinstance(network, JointConfig)
    monkeypatch.setattr(policy, "card", replace(policy.card, network=replace(network, reads_sides=False)))
    policy.infer(scene, left)
    assert len(asked) == 1
