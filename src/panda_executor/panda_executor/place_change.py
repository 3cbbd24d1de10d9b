"""Changes where the hand is to go down that a later cloud shows, while the arm was on its way there."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy import ndimage

from cliport_core.workspace import WorkspaceSpec
from panda_executor.drag import DragPlan
from panda_executor.errors import TrajectoryError
from panda_executor.motions import Motion, MotionBuilder
from panda_executor.obstacle_grid import EMPTY, ObstacleGrid
from panda_executor.transfer_attempts import PickPlacePlan
from panda_model.limits import FloatArray

_BELOW_LOAD = 0.02  # what lies so far below what is held is neither hand nor load [m]
_WAY_S = 0.02  # between two looks at where the hand was on its way [s]
_BESIDE = 0.02  # so far beside where the hand was it may have been, too, between its points and two looks [m]
_TOLERANCE = 0.01  # what rose or moved by less stands where it stood [m]
_SUNK = 0.015  # a cell that is lower by this much does not support any more [m]
_SQUARE = np.ones((2, 2))  # cells that a thing fills at least
_MIN_CELLS = 8  # of the support that must be seen; fewer prove nothing


class LaterView(NamedTuple):
    """A later view, with the arm above where the hand is to go down.

    cloud: (N, 3) [m, base frame]; positions: (7,) [rad], where the arm stands, with what it holds.
    """

    cloud: npt.NDArray[np.float32]
    workspace: WorkspaceSpec
    positions: FloatArray

    def below(self, way: Motion, ahead: Motion, motions: MotionBuilder) -> ObstacleGrid:
        """Return the columns of what lies lower than the hand and what it holds, before it goes `ahead`.

        Nor do they hold what lies where hand and load were on their `way`: the cloud may have been taken during it.
        """
        scene, hand = motions.config.scene, ahead.scene.hand.points
        rotation, translation = motions.model.tcp_arrays(self.positions)
        limit = float((hand @ rotation[2]).min() + translation[2]) - _BELOW_LOAD
        low = self.cloud[self.cloud[:, 2] < limit]  # NaN compares false
        grid = ObstacleGrid.empty(self.workspace, scene.grid_cell)
        row, col, inside = grid.cells_at(low[:, 0], low[:, 1])
        row, col, low = row[inside], col[inside], low[inside]
        low = low[low[:, 2] < _underside(grid, way, hand, motions)[row, col] - _BELOW_LOAD]
        return ObstacleGrid.from_cloud(low, self.workspace, scene.table_z + scene.floor, scene.grid_cell)


def place_problem(plan: PickPlacePlan, view: LaterView, motions: MotionBuilder) -> str | None:
    """Return why the plan's release does not hold among what is seen, or None where it does.

    Only what lies lower than hand and load counts, and only where it is seen: the hand hides much of the place.
    """
    seen = view.below(plan.carry, plan.lower, motions)
    problem = _in_the_way(what_came(plan.go_above.scene.grid, seen), (plan.lower, plan.leave), motions)
    if problem is not None:
        return problem
    share = _sunk_share(plan, seen, motions)
    if share > motions.config.moved_share:
        return f"{100.0 * share:.0f} % of what was to carry the object is gone"
    return None


def pick_problem(plan: PickPlacePlan, view: LaterView, motions: MotionBuilder) -> str | None:
    """Return what came where the hand goes down to the object, beside it or onto it, or None; as `place_problem`.

    plan: for where the object is now.
    """
    others = view._replace(cloud=view.cloud[~plan.grasp.owns(view.cloud)])
    seen = others.below(plan.go_above, plan.descend, motions)
    return _in_the_way(what_came(plan.go_above.scene.grid, seen), (plan.descend, plan.raise_up), motions)


def drag_problem(plan: DragPlan, view: LaterView, motions: MotionBuilder) -> str | None:
    """Return what came where the hand goes down, or came and is too tall to be moved, or None; as `place_problem`."""
    came = what_came(plan.go_above.scene.grid, view.below(plan.go_above, plan.descend, motions))
    tall = came.heights > motions.config.scene.table_z + motions.config.drag.low
    along = [motion for motion in (plan.lift, plan.drag, plan.leave) if motion is not None]
    problem = _in_the_way(came, (plan.descend,), motions)
    return problem or _in_the_way(replace(came, heights=np.where(tall, came.heights, EMPTY)), along, motions)


def what_came(before: ObstacleGrid, now: ObstacleGrid) -> ObstacleGrid:
    """Return those of the columns `now` that are new, or higher than `before`, as columns with nothing else."""
    return _solid(_risen(before, now))


def raised(before: ObstacleGrid, now: ObstacleGrid) -> ObstacleGrid:
    """Return the columns `before`, higher where `now` shows that something came."""
    return replace(before, heights=np.maximum(before.heights, what_came(before, now).heights))


def _underside(grid: ObstacleGrid, way: Motion, hand: FloatArray, motions: MotionBuilder) -> FloatArray:
    """Return how low points of the hand (N, 3) [m, tcp] came on a way over each cell (rows, cols) [m]; else inf."""
    lowest = np.full(grid.heights.shape, np.inf)
    duration = way.trajectory.duration
    for positions in way.trajectory.sample(np.linspace(0.0, duration, 1 + int(np.ceil(duration / _WAY_S))))[0]:
        rotation, translation = motions.model.tcp_arrays(positions)
        points = hand @ rotation.T + translation
        row, col, inside = grid.cells_at(points[:, 0], points[:, 1])
        np.minimum.at(lowest, (row[inside], col[inside]), points[inside, 2])
    reach = int(np.ceil(_BESIDE / grid.cell))
    return np.asarray(ndimage.minimum_filter(lowest, size=2 * reach + 1))


def _in_the_way(came: ObstacleGrid, ways: Iterable[Motion], motions: MotionBuilder) -> str | None:
    """Return which of the ways what came is in, in words, or None."""
    if came.highest <= 0.0:
        return None
    try:
        for way in ways:
            motions.among(way, came)
    except TrajectoryError as error:
        return f"something came there: {error}"
    return None


def _risen(before: ObstacleGrid, now: ObstacleGrid) -> ObstacleGrid:
    """Return the columns that are new or higher, but for those that may have been a little beside before."""
    reach = int(np.ceil(_TOLERANCE / before.cell))
    around = ndimage.maximum_filter(before.heights, size=2 * reach + 1)
    new = now.heights > np.maximum(around, 0.0) + _TOLERANCE
    return replace(now, heights=np.where(new, now.heights, EMPTY), seen=None, cameras=())


def _solid(grid: ObstacleGrid) -> ObstacleGrid:
    """Return the columns but for those in no square of risen ones.

    At the hand's edge a pixel that is half hand, half table seems to fly between them.
    """
    filled = ndimage.binary_opening(grid.heights > EMPTY, _SQUARE)
    return replace(grid, heights=np.where(filled, grid.heights, EMPTY))


def _sunk_share(plan: PickPlacePlan, now: ObstacleGrid, motions: MotionBuilder) -> float:
    """Return which share of the cells that were to carry the object is seen to be lower now, 0..1."""
    held, before = plan.lower.scene.hand.held, plan.lower.scene.grid
    if held is None or now.seen is None:
        return 0.0
    rotation, translation = motions.model.tcp_arrays(plan.lower.trajectory.positions[-1])
    under = held.cells @ rotation[:2, :2].T + translation[:2]
    row, col, inside = now.cells_at(under[:, 0], under[:, 1])
    row, col = np.unique(np.stack([row[inside], col[inside]]), axis=1)
    old, new = before.heights[row, col], np.maximum(now.heights[row, col], motions.config.scene.table_z)
    carrying = (old > plan.placement.support_z - _TOLERANCE) & now.seen[row, col]
    if int(carrying.sum()) < _MIN_CELLS:
        return 0.0
    return float((new[carrying] < old[carrying] - _SUNK).mean())
