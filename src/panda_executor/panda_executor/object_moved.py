"""The share of an object's place that a later cloud shows to be empty, and how far the object went."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy import ndimage

from panda_executor.grasp import Grasp
from panda_model.limits import FloatArray

_MIN_CELLS = 20  # of the object that must be seen; fewer prove nothing
REACH = 0.02  # within this an object is followed, along x and y each [m]
_AS_GOOD = 0.03  # of two shifts that explain so nearly the same share of the cells, none is better
_ABOVE_TOP = 0.02  # what is seen so far above the object is the hand [m]


def moved_problem(cloud: npt.NDArray[np.float32], grasp: Grasp, limit: float) -> str | None:
    """Return in words that more than the share `limit` of the object's seen cells is empty later on, or None."""
    share = vacated_share(cloud, grasp)
    if share <= limit:
        return None
    return f"the object moved: {100.0 * share:.0f} % of its place is empty (at most {100.0 * limit:.0f} %)"


def vacated_share(cloud: npt.NDArray[np.float32], grasp: Grasp) -> float:
    """Return which share of the object's seen cells is empty in a later cloud (N, 3) [m, base frame], 0..1.

    The cells are those that rose over half of its height; one is empty where something lower is seen: what the hand
    hides is taken to be there still.
    """
    highest, own = _highest(cloud, grasp, 0)
    tops = highest[own[:, 1], own[:, 0]]
    seen = np.isfinite(tops)
    if int(seen.sum()) < _MIN_CELLS:
        return 0.0
    return float((tops[seen] < grasp.half_height).mean())


def seen_shift(cloud: npt.NDArray[np.float32], grasp: Grasp) -> FloatArray | None:
    """Return how far the object went, (2,) [m, base frame], as a later cloud (N, 3) shows; None for 2 cm or more.

    Looked for is the shift, of less than 2 cm along x and y each, that puts most of the object's cells onto what is as
    high as it, and fewest onto lower ground. Where several do, as part of the ground is hidden, it is the middle of
    those around the shortest of them. None where these go on to the border of what is searched, and zero where they
    come from no shift at all: such an object is longer than what is looked at. Zero, too, where less than half of the
    object's place is seen: what stands beside it would be taken for it.
    """
    border = round(REACH / grasp.cell)
    highest, own = _highest(cloud, grasp, border)
    known = highest < grasp.highest_z + _ABOVE_TOP
    votes = np.where(np.isfinite(highest) & known, np.where(highest >= grasp.half_height, 1, -1), 0)
    if np.count_nonzero(votes[own[:, 1], own[:, 0]]) < len(own) / 2:
        return np.zeros(2)
    steps = range(-border, border + 1)
    scores = np.array([[votes[own[:, 1] + dy, own[:, 0] + dx].sum() for dx in steps] for dy in steps])
    good = scores >= scores.max() - _AS_GOOD * len(own)
    rows, cols = np.array(np.nonzero(good)) - border
    shortest = int(np.argmin(rows**2 + cols**2))
    parts, _ = ndimage.label(good, np.ones((3, 3)))
    around = parts == parts[rows[shortest] + border, cols[shortest] + border]
    rows, cols = np.array(np.nonzero(around)) - border
    if max(np.abs(rows).max(), np.abs(cols).max()) < border:
        return np.array([cols.mean(), rows.mean()]) * grasp.cell
    return np.zeros(2) if ((rows == 0) & (cols == 0)).any() else None


def _highest(cloud: npt.NDArray[np.float32], grasp: Grasp, border: int) -> tuple[FloatArray, npt.NDArray[np.int64]]:
    """Return the highest point of each cell (rows, cols) around the object, -inf where nothing is seen, and its cells.

    The object's cells, those over half of its height, are (M, 2) columns and rows of that map, which is wider by
    `border` cells on each side.
    """
    cells = np.unique(np.floor(grasp.high / grasp.cell).astype(np.int64), axis=0)
    first, size = cells.min(axis=0) - border, np.ptp(cells, axis=0) + 1 + 2 * border
    relative = np.floor((cloud[:, :2] - grasp.centroid[:2]) / grasp.cell)
    near = np.all((relative >= first) & (relative < first + size), axis=1)  # NaN compares false
    index = relative[near].astype(np.int64) - first
    highest = np.full((int(size[1]), int(size[0])), -np.inf)
    np.maximum.at(highest, (index[:, 1], index[:, 0]), cloud[near, 2].astype(np.float64))
    return highest, cells - first
