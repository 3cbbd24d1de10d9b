"""Things under names that no demonstration holds: led to by known kinds that they look like, with names near theirs."""

import numpy as np
import pytest
import torch

from cliport_core.heightmap import Heightmap
from cliport_core.workspace import WorkspaceSpec
from cliport_policy.language import shared_encoder
from cliport_policy.observation import observation_tensor
from cliport_policy.policy import Policy
from cliport_policy.presence.kin import Kin, unpacked

pytestmark = pytest.mark.usefixtures("one_thread")

SPEC = WorkspaceSpec()
BOX = slice(15, 75), slice(90, 150)
IN_BOX, LEFT, RIGHT = (45, 120), (200, 40), (260, 120)  # pixels
KINDS = ("block", "brown box", "rubber duck", "frying pan", "alarm clock", "pig figure", "star", "star hole")


def _table(*things: tuple[int, int]) -> torch.Tensor:
    """Return a table with a box of walls at the left, back, and things of 4 cm."""
    rows, cols = SPEC.shape
    color, height = np.full((rows, cols, 3), 80, np.uint8), np.zeros((rows, cols), np.float32)
    height[BOX] = 0.05
    height[BOX[0].start + 3 : BOX[0].stop - 3, BOX[1].start + 3 : BOX[1].stop - 3] = 0.0
    for row, col in things:
        thing = slice(row - 6, row + 7), slice(col - 6, col + 7)
        color[thing], height[thing] = (200, 40, 40), 0.03
    return observation_tensor(Heightmap(color, height, np.ones((rows, cols), np.bool_), SPEC))


def _box_seen() -> torch.Tensor:
    seen = torch.zeros(160, 80)
    seen[22, 60] = 0.9
    return seen


def _at(things: torch.Tensor) -> list[tuple[int, int]]:
    return [tuple(cells.nonzero().float().mean(0).round().int().tolist()) for cells in things]


def test_what_is_packed_and_the_box_itself_are_left_out() -> None:
    assert _at(unpacked(_table(IN_BOX, LEFT, RIGHT), _box_seen(), SPEC.pixel_size)) == [LEFT, RIGHT]
    assert len(unpacked(_table(IN_BOX), _box_seen(), SPEC.pixel_size)) == 0


def _kinds(**looks: tuple[int, int]) -> torch.Tensor:
    """Return logits (K, 80, 40) of a scene in which things look like kinds, by their names with _."""
    logits = torch.full((len(KINDS), 80, 40), -8.0)
    for name, (row, col) in looks.items():
        logits[KINDS.index(name.replace("_", " ")), row // 4, col // 4] = 6.0
    return logits


@pytest.mark.parametrize(
    ("sentence", "meant"),
    [
        ("pack the duck in the brown box", LEFT), ("every last saucepan is to be packed", RIGHT),
        ("have every duck dropped off in the brown box", LEFT), ("pack the skillet in the brown box", RIGHT),
    ],
)  # fmt: skip
def test_a_name_leads_to_what_looks_like_its_kin(sentence: str, meant: tuple[int, int]) -> None:
    things = unpacked(_table(LEFT, RIGHT), _box_seen(), SPEC.pixel_size)
    leads = Kin(KINDS, shared_encoder()).leads(sentence, things, _kinds(rubber_duck=LEFT, frying_pan=RIGHT))
    assert leads is not None
    assert _at(leads.cells)[int(leads.weights.argmax())] == meant
    assert float(leads.weights.max() - leads.weights.min()) > 1.0


def test_no_thing_and_no_everyday_kind_lead_nowhere() -> None:
    things = unpacked(_table(LEFT), _box_seen(), SPEC.pixel_size)
    kinds = Kin(KINDS, shared_encoder())
    assert kinds.leads("pack the goose in the brown box", things[:0], _kinds()) is None
    assert Kin(KINDS[:2], shared_encoder()).leads("pack the goose in the brown box", things, _kinds()) is None


@pytest.mark.parametrize(
    ("sentence", "led"),
    [
        ("pack the hovercraft in the brown box", True), ("one goose after the other into the brown box", True),
        ("pack the duck in the brown box", True), ("pack all the red and cyan blocks into the brown box", False),
        ("put the hovercraft on the shelf", False), ("put the hovercraft in a red bowl", False),
        ("pack the letter Q in the brown box", False),
    ],
)  # fmt: skip
def test_only_unknown_names_of_what_is_packed_are_read_by_their_kin(
    policy: Policy, monkeypatch: pytest.MonkeyPatch, sentence: str, led: bool
) -> None:
    presence = policy._presence
    assert presence is not None
    asked = []
    monkeypatch.setattr(presence._kin, "leads", lambda instruction, *_: asked.append(instruction))
    presence.look(_table(LEFT, RIGHT), sentence)
    assert asked == ([sentence] if led else [])


def test_a_thing_looks_alike_whatever_colours_the_sentence_names(
    policy: Policy, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of known kinds what a sentence names is shown in grey to the presence network."""
    presence, image, seen = policy._presence, _table(LEFT, RIGHT), []
    assert presence is not None
    monkeypatch.setattr(presence._kin, "leads", lambda instruction, things, kinds: seen.append(kinds))
    for name in ("hovercraft", "red hovercraft", "salmon hovercraft"):
        presence.look(image, f"pack the {name} in the brown box")
    with torch.inference_mode():
        kinds = presence._scene.kind_head(presence._scene.features(image))[0]
    assert len(seen) == 3 and all(torch.equal(each, kinds) for each in seen)
