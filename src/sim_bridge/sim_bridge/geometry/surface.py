"""Points on the surface of a mesh."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from sim_bridge.geometry.mesh import TriangleMesh


def surface_points(mesh: TriangleMesh, count: int) -> npt.NDArray[np.float64]:
    """Return points (count, 3) [m] scattered evenly over a mesh, always the same ones."""
    corners = mesh.vertices[mesh.triangles].astype(np.float64)
    sides = corners[:, 1:] - corners[:, :1]
    areas = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1)
    which = np.searchsorted(np.cumsum(areas) / areas.sum(), (np.arange(count) + 0.5) / count)
    share = np.random.default_rng(0).random((count, 2))
    share = np.where(share.sum(axis=1, keepdims=True) > 1.0, 1.0 - share, share)
    return np.asarray(corners[which, 0] + np.einsum("nk,nkd->nd", share, sides[which]))
