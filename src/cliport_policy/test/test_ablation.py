"""Policies without some parts of their network."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from cliport_core import Heightmap, WorkspaceSpec
from cliport_policy.ablation import PARTS
from cliport_policy.errors import ConfigError
from cliport_policy.policy import Policy, load_policy

SPEC = WorkspaceSpec()
SENTENCE = "put the red blocks in a green bowl"


def _scene() -> Heightmap:
    color = np.full((*SPEC.shape, 3), 80, np.uint8)
    height = np.zeros(SPEC.shape, np.float32)
    for row, paint in ((60, (200, 30, 30)), (200, (30, 160, 60))):
        color[row : row + 16, 80:96], height[row : row + 16, 80:96] = paint, 0.04
    return Heightmap(color, height, np.ones(SPEC.shape, np.bool_), SPEC)


@pytest.mark.parametrize("part", PARTS)
def test_the_shipped_policy_acts_without_each_part(part: str, policy: Policy) -> None:
    lacking = load_policy(left_out=[part])
    assert getattr(policy.card.network, part) and not getattr(lacking.card.network, part)
    assert lacking.infer(_scene(), SENTENCE).action is not None


def test_without_the_aligner_places_are_what_the_correlation_says(policy: Policy) -> None:
    whole, lacking = (one.score(_scene(), SENTENCE) for one in (policy, load_policy(left_out=["aligner"])))
    assert (whole.picks == lacking.picks).all() and not (whole.places == lacking.places).all()


def test_what_cannot_be_left_out_is_named(tiny_checkpoint: Callable[..., Path]) -> None:
    with pytest.raises(ConfigError, match=r"'rotator' is no part that can be left out: name some of aligner, compares"):
        load_policy(left_out=["rotator"])
    with pytest.raises(ConfigError, match="this network has no aligner to leave out"):
        load_policy(tiny_checkpoint("compact"), left_out=["aligner"])
