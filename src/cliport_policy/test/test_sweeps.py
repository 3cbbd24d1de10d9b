"""Sweeps begin where they meet something."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
import torch

from cliport_core import Heightmap, WorkspaceSpec
from cliport_core.action import Primitive
from cliport_policy.observation import observation_tensor
from cliport_policy.policy import Policy
from cliport_policy.sweeps import meets_something

SPEC = WorkspaceSpec()
SWEEP = "push the pile of red blocks into the green square"
BESIDE, BEHIND = (200, 40), (100, 80)  # starts: nothing lies beside; a pile lies between the other and END
END = (250, 80)


def _scene(*blocks: tuple[int, int], side: int = 4) -> Heightmap:
    """A table on which blocks of 1 cm stand, at their first pixels."""
    color = np.full((*SPEC.shape, 3), 80, np.uint8)
    height = np.zeros(SPEC.shape, np.float32)
    for row, col in blocks:
        color[row : row + side, col : col + side] = (200, 30, 30)
        height[row : row + side, col : col + side] = 0.01
    return Heightmap(color, height, np.ones(SPEC.shape, np.bool_), SPEC)


@pytest.mark.parametrize(
    ("block", "met"),
    [
        ((150, 78), True),
        ((150, 84), False),  # its near edge is 1 cm aside: less than half of it is near
        ((150, 88), False),  # beside the way
        ((90, 78), False),  # behind the start
        ((258, 78), False),  # beyond the end
    ],
)
def test_something_is_met_on_the_way(block: tuple[int, int], met: bool) -> None:
    image = observation_tensor(_scene(block))
    assert meets_something(image, BEHIND, END, SPEC.pixel_size) == met
    turned = image.transpose(2, 3)
    assert meets_something(turned, BEHIND[::-1], END[::-1], SPEC.pixel_size) == met


@pytest.mark.parametrize("block", [(97, 78), (100, 78), (106, 78)])
def test_a_short_sweep_meets_what_it_pushes_at_its_start_or_end(block: tuple[int, int]) -> None:
    """The last blocks of a pile are pushed a centimetre: begun elsewhere, a sweep takes others out of the square."""
    assert meets_something(observation_tensor(_scene(block)), BEHIND, (104, 80), SPEC.pixel_size)


def test_specks_and_what_lies_flat_are_nothing() -> None:
    assert not meets_something(observation_tensor(_scene((150, 78), side=2)), BEHIND, END, SPEC.pixel_size)
    flat = _scene((150, 78))
    low = replace(flat, height=flat.height * 0.5)
    assert not meets_something(observation_tensor(low), BEHIND, END, SPEC.pixel_size)
    assert meets_something(observation_tensor(_scene(BEHIND)), BEHIND, BEHIND, SPEC.pixel_size), "a way of no length"
    assert not meets_something(observation_tensor(_scene(END)), BEHIND, BEHIND, SPEC.pixel_size)


def _sure_of(policy: Policy, monkeypatch: pytest.MonkeyPatch, picks: dict[tuple[int, int], float]) -> None:
    """Let a policy's network find sweeps from some pixels to END alone, as likely as it says."""
    network, (rows, cols) = policy._network, policy.grid.shape
    grid = torch.full((rows, cols), -20.0)
    for (row, col), logit in picks.items():
        grid[row // 2, col // 2] = logit
    places = torch.full((1, 36, rows, cols), -20.0)
    places[0, 0, END[0] // 2, END[1] // 2] = 0.0
    scores = torch.cat((grid.flatten(), torch.full((network.n_null,), -20.0)))[None]
    sweep = torch.eye(len(Primitive))[[Primitive.SWEEP.value]]
    answers: dict[str, Callable[..., object]] = {
        "score_picks": lambda *_: scores,
        "score_primitives": lambda *_: sweep,
        "score_rotations": lambda *_: (torch.zeros(1, 36), places),
    }
    for name, answer in answers.items():
        monkeypatch.setattr(network, name, answer)


@pytest.mark.parametrize(
    ("blocks", "sweeps_things", "start"),
    [
        ([(150, 78)], True, BEHIND),
        ([(150, 78)], False, BESIDE),
        ([(150, 78), (225, 58)], True, BESIDE),  # the likeliest one meets something, too
        ([], True, BESIDE),  # none does
    ],
)
def test_a_sweep_begins_at_the_likeliest_place_that_meets_something(
    policy: Policy,
    monkeypatch: pytest.MonkeyPatch,
    blocks: list[tuple[int, int]],
    sweeps_things: bool,
    start: tuple[int, int],
) -> None:
    _sure_of(policy, monkeypatch, {BESIDE: 1.0, BEHIND: 0.0})
    card = replace(policy.card, network=replace(policy.card.network, sweeps_things=sweeps_things))  # type: ignore[type-var]
    monkeypatch.setattr(policy, "card", card)
    found = policy.infer(_scene(*blocks), SWEEP)
    assert found.action is not None and found.action.primitive is Primitive.SWEEP
    assert np.abs(np.subtract(found.pick_pixel, start)).max() <= 1 and found.place_pixel[1] in (80, 81)
