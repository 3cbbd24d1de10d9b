"""Which demonstrations a recorded scene holds beside the expert's own, and what is written of the things in it."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from cliport_benchmark.episode_recorder import _other_demos, _reached_before, seen_things
from cliport_core import Primitive
from cliport_core.workspace import WorkspaceSpec
from cliport_policy.data.dataset_format import Demo


def task(several: bool = True) -> Any:
    goals = [SimpleNamespace(sentence=name) for name in ("alpha", "beta", "gamma")]
    return SimpleNamespace(
        several_goals=several,
        goals_in_scene=lambda: goals,
        expert_action_for=lambda goal: None,
        primitive=Primitive.PICK_PLACE,
        sentences_done=["alpha", "beta"],
    )


def others(said: str, at_most: int, several: bool = True, seed: int = 0) -> list[str]:
    found = _other_demos(task(several), said, np.random.default_rng(seed), at_most, WorkspaceSpec())
    assert all(demo.done and demo.primitive == Primitive.PICK_PLACE.label for demo in found)
    return [demo.instruction for demo in found]


@pytest.mark.parametrize("said", ["alpha", "beta", "gamma"])
def test_other_goals_are_all_but_the_one_that_is_said(said: str) -> None:
    assert sorted(others(said, 9)) == sorted({"alpha", "beta", "gamma"} - {said})
    assert {tuple(others(said, 1, seed=seed)) for seed in range(20)} == {(s,) for s in others(said, 2)}
    assert others(said, 0) == others(said, 9, several=False) == []


@pytest.mark.parametrize(("said", "left"), [("alpha", ["beta"]), ("beta", ["alpha"]), ("gamma", ["alpha", "beta"])])
def test_what_was_reached_before_is_shown_as_done(said: str, left: list[str]) -> None:
    expected = [Demo(sentence, done=True, primitive=Primitive.PICK_PLACE.label) for sentence in left]
    assert _reached_before(task(), said) == expected


def test_things_have_their_colour_as_a_number_and_no_place_outside() -> None:
    workspace = WorkspaceSpec()
    inside = workspace.pixel_to_xy(20, 30)
    things = [
        SimpleNamespace(name="block 1", color="red", rgb=(0x12, 0x34, 0x56), at=inside),
        SimpleNamespace(name="bowl 2", color="green", rgb=(255, 0, 1), at=(99.0, 0.0)),
    ]
    world: Any = SimpleNamespace(objects=things, object_xy=lambda thing: thing.at)
    assert [(t.name, t.color, t.rgb, t.row, t.col) for t in seen_things(world, workspace)] == [
        ("block 1", "red", 0x123456, 20, 30),
        ("bowl 2", "green", 0xFF0001, -1, -1),
    ]
