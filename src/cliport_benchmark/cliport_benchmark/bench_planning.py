"""The planner's searches side by side, among random columns."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import numpy.typing as npt
from ompl import geometric

from cliport_core.workspace import WorkspaceSpec
from panda_executor.config import SearchAlgorithm, SearchConfig
from panda_executor.errors import ExecutorError
from panda_executor.hand_geometry import HandShape
from panda_executor.ik import hand_down_pose
from panda_executor.model import PandaModel
from panda_executor.obstacle_grid import ObstacleGrid
from panda_executor.path_search import MakePlanner, find_path, line_is_free
from panda_executor.plan_preview import joined, paths, picture
from panda_executor.scene import Scene
from panda_executor.transfer import TransferPlanner
from panda_executor.transfer_attempts import PickPlacePlan
from panda_model import FloatArray

# Planners of OMPL's that the executor does not offer. Without PRM: it looks for ways in a thread of its own, and does
# not come back where validity is judged in Python.
OTHERS: dict[str, MakePlanner] = {
    "rrt": geometric.RRT,
    "kpiece": geometric.KPIECE1,
    "lbkpiece": geometric.LBKPIECE1,
    "bit_star": geometric.BITstar,
}
_COLUMNS = 8  # in a scene
_FLOOR = 0.012  # what is lower is the table [m]
Query = tuple[Scene, FloatArray, FloatArray]


def drawn(planner: TransferPlanner, plan: PickPlacePlan) -> npt.NDArray[np.uint8]:
    """Return the picture (H, W, 3) of a plan's preview, after everything else that is computed for one."""
    joined(plan.motions)
    return picture(plan.motions[0].scene.grid, paths(planner.model, plan.motions))


def clutter_queries(count: int, seed: int = 0) -> list[Query]:
    """Return scenes of columns 5 to 25 cm high, each with two configurations (7,) [rad] that no straight way joins."""
    planner, random = TransferPlanner(PandaModel()), np.random.default_rng(seed)
    found: list[Query] = []
    while len(found) < count:
        scene = _scene(planner, random)
        ends = [_above(planner, random, side) for side in (-1.0, 1.0)]
        if all(end is not None and scene.is_valid(end) for end in ends):
            start, goal = (np.asarray(end) for end in ends)
            if not line_is_free(scene, start, goal):
                found.append((scene, start, goal))
    return found


def search_times(
    algorithm: SearchAlgorithm, queries: list[Query], make_planner: MakePlanner | None = None
) -> tuple[list[float], int]:
    """Return the milliseconds of each search and of shortening its way, and how many found one.

    make_planner: another planner of OMPL's in place of the algorithm's, within the same bounds.
    """
    config = replace(SearchConfig(), algorithm=algorithm)
    times, successes = [], 0
    for scene, start, goal in queries:
        began = time.perf_counter()
        try:
            find_path(scene, start, goal, config, make_planner=make_planner)
            successes += 1
        except ExecutorError:
            pass
        times.append(1000.0 * (time.perf_counter() - began))
    return times, successes


def compared(count: int) -> Iterator[tuple[str, list[float], float]]:
    """Yield each algorithm's name, its times [ms], and its share of searches that found a way [%]."""
    queries = clutter_queries(count)
    for algorithm in SearchAlgorithm:
        times, successes = search_times(algorithm, queries)
        yield algorithm.value, times, 100.0 * successes / count
    for name, make_planner in OTHERS.items():
        times, successes = search_times(SearchConfig().algorithm, queries, make_planner)
        yield name, times, 100.0 * successes / count


def _scene(planner: TransferPlanner, random: np.random.Generator) -> Scene:
    workspace = WorkspaceSpec()
    points = []
    for _ in range(_COLUMNS):
        x, y = random.uniform([0.35, -0.2], [0.6, 0.2])
        half, height = random.uniform([0.02, 0.05], [0.04, 0.25])
        step = np.arange(-half, half, 0.002)
        across, along = np.meshgrid(x + step, y + step)
        points.append(np.column_stack([across.ravel(), along.ravel(), np.full(across.size, height)]))
    grid = ObstacleGrid.from_cloud(np.concatenate(points).astype(np.float32), workspace, _FLOOR)
    return planner.scene(grid, HandShape(planner.config.hand, margin=planner.config.clearance))


def _above(planner: TransferPlanner, random: np.random.Generator, side: float) -> FloatArray | None:
    """Return a configuration low over one side of the workspace, or None where the arm does not reach it."""
    x, y, z = random.uniform([0.4, 0.25, 0.1], [0.6, 0.35, 0.18])
    try:
        return planner.ik.solve_all(hand_down_pose(x, side * y, z, 0.0), planner.ready)[0].positions
    except ExecutorError:
        return None
