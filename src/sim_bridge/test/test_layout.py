"""Scenes have room for the hand, stay inside the workspace, and differ between splits."""

import math

import numpy as np
import pytest

from cliport_perception import WorkspaceSpec
from sim_bridge.errors import LayoutError
from sim_bridge.objects import Kind
from sim_bridge.tasks import Split
from sim_bridge.tasks.layout import CLEARANCE, MARGIN, sample_layout
from sim_bridge.world import scene_rng

TASK = "put-blocks-in-bowls-seen-colors"


@pytest.mark.parametrize("n_bowls", [1, 3, 9])
def test_clearances_hold_over_200_seeds(n_bowls: int) -> None:
    workspace = WorkspaceSpec()
    kinds = [Kind.BOWL] * n_bowls + [Kind.BLOCK] * (12 - n_bowls)
    for seed in range(200 // 3):
        places = sample_layout(kinds, workspace, scene_rng(TASK, Split.TRAIN, seed))
        for i, (kind, place) in enumerate(zip(kinds, places, strict=True)):
            margin = MARGIN[kind] - 1e-9
            assert workspace.x_min + margin <= place.x <= workspace.x_max - margin
            assert workspace.y_min + margin <= place.y <= workspace.y_max - margin
            for other_kind, other in zip(kinds[:i], places[:i], strict=True):
                distance = math.hypot(place.x - other.x, place.y - other.y)
                assert distance >= CLEARANCE[frozenset({kind, other_kind})]


def test_too_many_objects_end_in_an_error() -> None:
    with pytest.raises(LayoutError, match="no room for 40 objects"):
        sample_layout([Kind.BOWL] * 40, WorkspaceSpec(), np.random.default_rng(0))


def test_same_seed_gives_other_numbers_in_other_splits_tasks_and_streams() -> None:
    draws = {
        float(scene_rng(task, split, 7, stream).random())
        for task in (TASK, "put-blocks-in-bowls-unseen-colors")
        for split in Split
        for stream in (0, 1, 2)
    }
    assert len(draws) == 2 * 3 * 3
