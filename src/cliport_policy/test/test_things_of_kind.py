"""Things of a named kind: where picks are led to, and what lies in its box already."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from cliport_core.heightmap import Heightmap
from cliport_core.workspace import WorkspaceSpec
from cliport_policy.card import resolve_checkpoint
from cliport_policy.checkpoint import load_checkpoint
from cliport_policy.joint_config import JointConfig
from cliport_policy.language import shared_encoder
from cliport_policy.leading import Leads, led_picks
from cliport_policy.observation import observation_tensor
from cliport_policy.policy import Policy
from cliport_policy.presence.stored import load_presence
from cliport_policy.presence.things_of_kind import things_of_kind

pytestmark = pytest.mark.usefixtures("one_thread")

SPEC = WorkspaceSpec()
IN_BOX, ON_TABLE, OTHER = (10, 30), (50, 10), (65, 30)  # cells of 4 pixels
ODDS = {share: math.log(share / (1 - share)) for share in (0.9, 0.8, 0.6, 0.98, 0.02)}


def _table(patterned: bool = False) -> torch.Tensor:
    """Return a table with a brown box at the left, back, and three things of 4 cm."""
    rows, cols = SPEC.shape
    color, height = np.full((rows, cols, 3), 80, np.uint8), np.zeros((rows, cols), np.float32)
    if patterned:
        color[:] = np.random.default_rng(0).integers(0, 256, (rows // 8, cols // 8, 3)).repeat(8, 0).repeat(8, 1)
    color[15:75, 90:150] = (156, 117, 95)
    for row, col in (IN_BOX, ON_TABLE, OTHER):
        thing = slice(4 * row - 6, 4 * row + 7), slice(4 * col - 6, 4 * col + 7)
        color[thing], height[thing] = (200, 40, 40), 0.03
    return observation_tensor(Heightmap(color, height, np.ones((rows, cols), np.bool_), SPEC))


def _shares(**seen: float) -> torch.Tensor:
    shares = torch.full((80, 40), 0.01)
    for name, share in seen.items():
        shares[globals()[name]] = share
    return shares


def _held(leads: Leads | None, cell: tuple[int, int]) -> list[bool]:
    assert leads is not None
    return [bool(cells[2 * cell[0], 2 * cell[1]]) for cells in leads.cells]


def test_picks_are_led_to_what_lies_on_the_table_and_not_to_what_is_packed() -> None:
    found = things_of_kind(_table(), _shares(IN_BOX=0.9, ON_TABLE=0.8, OTHER=0.6), SPEC.pixel_size, packed=True)
    assert found.leads is not None and len(found.leads.cells) == 2
    assert _held(found.leads, ON_TABLE) == [True, False] and _held(found.leads, OTHER) == [False, True]
    assert found.leads.weights.tolist() == pytest.approx([ODDS[0.8], ODDS[0.6]], abs=1e-5)
    assert found.placed == pytest.approx(0.4 * (ODDS[0.9] - ODDS[0.8]))
    picks = led_picks(torch.zeros(160, 80), found.leads)
    row, col = divmod(int(picks.argmax()), 80)
    assert math.hypot(row - 2 * ON_TABLE[0], col - 2 * ON_TABLE[1]) < 6, "the likelier one"


def test_all_that_is_packed_says_done() -> None:
    found = things_of_kind(_table(), _shares(IN_BOX=0.9), SPEC.pixel_size, packed=True)
    assert found.leads is None and found.placed == pytest.approx(0.4 * (ODDS[0.9] - ODDS[0.02]))
    nothing = things_of_kind(_table(), _shares(), SPEC.pixel_size, packed=True)
    assert nothing == (None, 0.0)


@pytest.mark.parametrize(("patterned", "packed"), [(False, False), (True, True)])
def test_all_things_may_be_picked_where_no_box_is_named_or_told_from_the_table(patterned: bool, packed: bool) -> None:
    found = things_of_kind(_table(patterned), _shares(IN_BOX=0.9, ON_TABLE=0.8), SPEC.pixel_size, packed)
    assert found.placed == 0.0 and _held(found.leads, IN_BOX) == [True, False]


def test_two_cells_of_one_thing_are_one() -> None:
    shares = _shares(ON_TABLE=0.8)
    shares[ON_TABLE[0] + 1, ON_TABLE[1] + 1] = 0.7
    found = things_of_kind(_table(), shares, SPEC.pixel_size, packed=True)
    assert found.leads is not None and len(found.leads.cells) == 1


@pytest.mark.parametrize(
    ("sentence", "leads"),
    [
        ("pack the rubber duck in the brown box", True), ("pack all the rubber duck objects in the brown box", True),
        ("put the gray blocks in a red bowl", False), ("push the pile of red blocks into the green square", False),
        ("align the rope from front left tip to back right corner", False),
        ("put the hovercraft in a red bowl", False), ("put the hovercraft on the shelf", False),
    ],
)  # fmt: skip
def test_only_things_that_their_kind_tells_apart_are_looked_for(
    policy: Policy, monkeypatch: pytest.MonkeyPatch, sentence: str, leads: bool
) -> None:
    """Neither by colours, nor of a pile or a rope, nor by other words than those of the demonstrations."""
    presence = policy._presence
    assert presence is not None
    monkeypatch.setattr(presence, "_seen", lambda role, *_: _shares(ON_TABLE=0.9).expand(len(role.kinds), -1, -1))
    assert (presence.look(_table(), sentence).leads is not None) == leads


def test_a_policy_whose_card_does_not_say_so_is_not_led(tmp_path: Path) -> None:
    tensors, card = load_checkpoint(resolve_checkpoint("default"))
    assert isinstance(card.network, JointConfig)
    without = replace(card, network=replace(card.network, reads_kinds=False))
    presence = load_presence(tensors, without, shared_encoder(), tmp_path)
    assert presence is not None
    look = presence.look(_table(), "pack the rubber duck in the brown box")
    assert look.leads is None and look.placed == 0.0


def test_done_is_likelier_by_what_is_said_of_things_in_their_place(policy: Policy) -> None:
    scene = Heightmap(
        np.full((*SPEC.shape, 3), 80, np.uint8), np.zeros(SPEC.shape, np.float32), np.ones(SPEC.shape, np.bool_), SPEC
    )
    scores = policy.score(scene, "pack the rubber duck in the brown box")._replace(placed=0.0)
    before, after = (
        policy._decide(scores._replace(placed=placed), with_maps=False).inference.done_probability
        for placed in (0.0, 2.0)
    )
    assert math.log(after / (1 - after)) - math.log(before / (1 - before)) == pytest.approx(2.0, abs=1e-4)
