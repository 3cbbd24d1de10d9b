"""A polygon with holes, cut into convex pieces."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from sim_bridge.geometry import outlines

_STRAIGHT_AREA = 1e-10  # area of three corners that count as straight [m^2]


def convex_pieces(outline: npt.ArrayLike, holes: Sequence[npt.ArrayLike] = ()) -> list[npt.NDArray[np.float64]]:
    """Cut a polygon into convex ones (K, 2), counter-clockwise, that together
    cover what `TriangleMesh.extruded` would cover.

    Triangles, of which neighbours are merged as long as that stays convex (Hertel and Mehlhorn), across the longest
    borders first.

    Raises:
        SimulationError: on an outline without area or that crosses itself.
    """
    rings = outlines.oriented(outline, holes)
    corners = np.concatenate(rings)
    pieces = [triangle.tolist() for triangle in outlines.triangulated(rings)]
    while (merged := _merge_once(pieces, corners)) is not None:
        pieces = merged
    return [corners[piece] for piece in pieces]


def _merge_once(pieces: list[list[int]], corners: npt.NDArray[np.float64]) -> list[list[int]] | None:
    """Merge the best two pieces and return all; None when no two may be merged."""
    owner = {edge: i for i, piece in enumerate(pieces) for edge in zip(piece, piece[1:] + piece[:1], strict=True)}
    shared = [(a, b) for a, b in owner if a < b and (b, a) in owner]
    for a, b in sorted(shared, key=lambda edge: -float(np.linalg.norm(corners[edge[0]] - corners[edge[1]]))):
        first, second = owner[a, b], owner[b, a]
        start, other = pieces[first].index(b), pieces[second].index(a)
        # once around the first from b to a, then around the second from a to b
        ring = pieces[first][start:] + pieces[first][:start] + (pieces[second][other:] + pieces[second][:other])[1:-1]
        if _is_convex(corners[ring]):
            return [piece for i, piece in enumerate(pieces) if i not in (first, second)] + [ring]
    return None


def _is_convex(ring: npt.NDArray[np.float64]) -> bool:
    before, after = ring - np.roll(ring, 1, axis=0), np.roll(ring, -1, axis=0) - ring
    return bool((before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0] > -_STRAIGHT_AREA).all())
