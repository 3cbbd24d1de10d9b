"""The share of an object's place that a later cloud shows to be empty."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from panda_executor.grasp import Grasp

_GONE_BELOW = 0.5  # a cell whose highest point is lower than this share of the object is vacated
_MIN_CELLS = 20  # of the object that must be seen; fewer prove nothing


def moved_problem(cloud: npt.NDArray[np.float32], grasp: Grasp, limit: float) -> str | None:
    """Return in words that more than the share `limit` of the object's seen cells is empty later on, or None."""
    share = vacated_share(cloud, grasp)
    if share <= limit:
        return None
    return f"the object moved: {100.0 * share:.0f} % of its place is empty (at most {100.0 * limit:.0f} %)"


def vacated_share(cloud: npt.NDArray[np.float32], grasp: Grasp) -> float:
    """Return which share of the object's seen cells is empty in a later cloud (N, 3) [m, base frame], 0..1.

    Only cells through which the ground below is seen count as empty: what the hand hides is taken to be there still.
    """
    cells = np.floor(grasp.inner / grasp.cell).astype(np.int64)
    first, size = cells.min(axis=0), np.ptp(cells, axis=0) + 1
    relative = np.floor((cloud[:, :2] - grasp.centroid[:2]) / grasp.cell)
    near = np.all((relative >= first) & (relative < first + size), axis=1)  # NaN compares false
    index = relative[near].astype(np.int64) - first
    flat = index[:, 1] * size[0] + index[:, 0]
    highest = np.full(int(size[0] * size[1]), -np.inf)
    np.maximum.at(highest, flat, cloud[near, 2].astype(np.float64))
    own = np.unique((cells[:, 1] - first[1]) * size[0] + cells[:, 0] - first[0])
    tops = highest[own]
    seen = np.isfinite(tops)
    if int(seen.sum()) < _MIN_CELLS:
        return 0.0
    limit = grasp.support_z + _GONE_BELOW * (grasp.top_z - grasp.support_z)
    return float((tops[seen] < limit).mean())
