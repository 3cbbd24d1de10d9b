"""Polygons with holes in a plane: their orientation, and triangles that cover them."""

from __future__ import annotations

from collections.abc import Sequence

import mapbox_earcut
import numpy as np
import numpy.typing as npt

from sim_bridge.errors import SimulationError

Ring = npt.NDArray[np.float64]


def signed_area(ring: Ring) -> float:
    """Return the area [m^2] within a ring of corners (N, 2), negative when they run clockwise."""
    x, y = ring.T
    return float(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2.0


def oriented(outline: npt.ArrayLike, holes: Sequence[npt.ArrayLike] = ()) -> list[Ring]:
    """Return the outline (N, 2) counter-clockwise, then each hole (K, 2) clockwise.

    Raises:
        SimulationError: when one has fewer than three finite corners or no area.
    """
    rings = []
    for i, corners in enumerate((outline, *holes)):
        ring = np.array(corners, dtype=np.float64)
        if ring.ndim != 2 or ring.shape[1] != 2 or len(ring) < 3 or not np.isfinite(ring).all():
            raise SimulationError(f"an outline needs three or more finite corners (N, 2), got {ring.shape}")
        area = signed_area(ring)
        if abs(area) < 1e-12:
            raise SimulationError(f"an outline of {len(ring)} corners has no area: are its corners in order?")
        rings.append(ring if (area > 0.0) == (i == 0) else ring[::-1].copy())
    return rings


def triangulated(rings: Sequence[Ring]) -> npt.NDArray[np.int64]:
    """Return triangles (M, 3), counter-clockwise, over the corners of all
    rings in turn; rings as `oriented` returns them.

    Raises:
        SimulationError: when the triangles do not cover the polygon, as when rings cross.
    """
    corners = np.concatenate(rings)
    ends = np.cumsum([len(ring) for ring in rings]).astype(np.uint32)
    triangles = mapbox_earcut.triangulate_float64(corners, ends).reshape(-1, 3).astype(np.int64)
    areas = [signed_area(corners[triangle]) for triangle in triangles]
    clockwise = np.array(areas) < 0.0
    triangles[clockwise] = triangles[clockwise][:, ::-1]
    wanted, covered = sum(signed_area(ring) for ring in rings), float(np.abs(areas).sum())
    if abs(covered - wanted) > 1e-6 * abs(wanted):
        raise SimulationError(
            f"triangles cover {covered:.3g} m^2 of a polygon of {wanted:.3g} m^2: "
            "its outline crosses itself, or a hole crosses or leaves it"
        )
    return triangles
