"""Merges convex pieces of a body: physics takes time for each."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from scipy.spatial import ConvexHull

FloatArray = npt.NDArray[np.float64]

_ADDED_SHARE = 0.01  # share of the whole volume that one union may add
_MAX_PIECES = 12  # pieces; beyond that a union may add more


def merged(pieces: Sequence[FloatArray]) -> list[FloatArray]:
    """Merge pieces whose joint hull adds little volume; corners (N, 3) of convex pieces in and out."""
    kept = dict(enumerate(_hull(piece) for piece in pieces))
    total = sum(volume for _, volume in kept.values())
    unions = {pair: _union(kept, *pair) for pair in itertools.combinations(kept, 2)}
    while unions:
        pair, (corners, volume, added) = min(unions.items(), key=lambda item: item[1][2])
        if added > _ADDED_SHARE * total and len(kept) <= _MAX_PIECES:
            break
        unions = {other: union for other, union in unions.items() if not set(other) & set(pair)}
        new = max(kept) + 1
        kept = {key: hull for key, hull in kept.items() if key not in pair} | {new: (corners, volume)}
        unions |= {(key, new): _union(kept, key, new) for key in kept if key != new}
    return [corners for corners, _ in kept.values()]


def _hull(corners: FloatArray) -> tuple[FloatArray, float]:
    """Return the vertices of the convex hull, and its volume."""
    hull = ConvexHull(corners)
    return corners[hull.vertices], float(hull.volume)


def _union(kept: dict[int, tuple[FloatArray, float]], a: int, b: int) -> tuple[FloatArray, float, float]:
    """Return corners and volume of the common hull of two pieces, and how much it is larger than both."""
    corners, volume = _hull(np.concatenate([kept[a][0], kept[b][0]]))
    return corners, volume, volume - kept[a][1] - kept[b][1]
