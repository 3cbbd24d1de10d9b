"""Searches in joint space: the same way for a seed, within their bounds, whatever stands there."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from walls import above, scene_with_wall

from panda_executor import path_search
from panda_executor.budget import Budget
from panda_executor.config import SearchAlgorithm, SearchConfig
from panda_executor.errors import PlanningError
from panda_executor.path_search import find_path, line_is_free
from panda_executor.scene import Scene
from panda_executor.transfer import TransferPlanner
from panda_model import FloatArray


@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize(
    ("wall", "z"), [((0.3, 0.75, 0.25), 0.15), ((0.48, 0.52, 0.27), 0.14), ((0.3, 0.55, 0.2), 0.1)]
)
def test_the_search_does_not_depend_on_luck(
    planner: TransferPlanner, wall: tuple[float, float, float], z: float, seed: int
) -> None:
    scene = scene_with_wall(planner, *wall)
    start, goal = (above(planner, 0.5, y, z) for y in (-0.2, 0.2))
    assert not line_is_free(scene, start, goal)
    path = find_path(scene, start, goal, SearchConfig(seed=seed, time_limit=60.0))
    assert all(line_is_free(scene, p, q) for p, q in pairwise(path))


def test_the_same_seed_finds_the_same_way(planner: TransferPlanner, walled: Scene) -> None:
    start, goal = (above(planner, 0.5, y, 0.08) for y in (-0.2, 0.2))
    config = SearchConfig(time_limit=60.0)
    a, b = (find_path(walled, start, goal, config) for _ in range(2))
    np.testing.assert_array_equal(a, b)
    assert all(line_is_free(walled, p, q) for p, q in pairwise(a))


def test_a_free_line_is_taken(planner: TransferPlanner, free_scene: Scene) -> None:
    start, goal = (above(planner, 0.5, y, 0.08) for y in (-0.2, 0.2))
    np.testing.assert_array_equal(find_path(free_scene, start, goal, SearchConfig()), [start, goal])


def test_ends_that_touch_are_named(planner: TransferPlanner, walled: Scene) -> None:
    inside, free = above(planner, 0.5, 0.0, 0.05), above(planner, 0.5, 0.2, 0.08)
    with pytest.raises(PlanningError, match="cannot start there: the hand would touch"):
        find_path(walled, inside, free, SearchConfig())
    with pytest.raises(PlanningError, match="cannot end there: the hand would touch"):
        find_path(walled, free, inside, SearchConfig())


@pytest.mark.parametrize("algorithm", list(SearchAlgorithm))
def test_the_search_ends_at_its_bounds(planner: TransferPlanner, walled: Scene, algorithm: SearchAlgorithm) -> None:
    start, goal = (above(planner, 0.5, y, 0.08) for y in (-0.2, 0.2))
    for config, clock in (
        (SearchConfig(algorithm, max_checks=20, time_limit=60.0), lambda: 0.0),
        (SearchConfig(algorithm), iter(range(0, 100000, 5)).__next__),
    ):
        with pytest.raises(PlanningError, match=r"no way round .* in \d+ checks"):
            find_path(walled, start, goal, config, clock)


def test_a_search_makes_all_the_checks_that_it_may(
    planner: TransferPlanner, walled: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    ends = [above(planner, 0.5, y, 0.08) for y in (-0.2, 0.2)]
    asked: list[FloatArray] = []

    def only_the_ends(_: Scene, positions: FloatArray) -> bool:
        asked.append(positions)
        return any(np.array_equal(positions, end) for end in ends)

    monkeypatch.setattr(Scene, "is_valid", only_the_ends)
    with pytest.raises(PlanningError, match=r"in 30\d checks"):
        find_path(walled, *ends, SearchConfig(max_checks=300, time_limit=60.0))
    assert len(asked) == 1 + 300  # the line's middle first


def test_the_star_search_looks_towards_its_end_as_often_as_it_is_told(planner: TransferPlanner, walled: Scene) -> None:
    config = SearchConfig(SearchAlgorithm.RRT_STAR, goal_bias=0.17, step=0.33)
    ends = np.stack([above(planner, 0.5, y, 0.08) for y in (-0.2, 0.2)])
    made = path_search._Search(walled, config, lambda: 0.0, Budget(), ends)._planner()
    assert (made.getGoalBias(), made.getRange()) == (0.17, 0.33)
