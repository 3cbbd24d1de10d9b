"""Triangle meshes of the simulated things, shared by physics and renderer."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt


@dataclass(frozen=True, eq=False)
class TriangleMesh:
    """vertices (N, 3) float32 [m] in the body frame; triangles (M, 3) int32, seen from outside ccw."""

    vertices: npt.NDArray[np.float32]
    triangles: npt.NDArray[np.int32]

    @classmethod
    def box(cls, size: tuple[float, float, float]) -> TriangleMesh:
        """A box of `size` (x, y, z) [m] about the origin."""
        corners = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
        quads = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
        triangles = [t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))]
        return cls((corners * size).astype(np.float32), np.array(triangles, dtype=np.int32))

    @classmethod
    def revolved(cls, profile: npt.ArrayLike, segments: int) -> TriangleMesh:
        """A closed outline of (radius, z) pairs [m], turned about z.

        The outline runs from the axis along the underside outwards and back along the upper side to the axis;
        its first and last point must lie on the axis (radius 0).
        """
        outline = np.asarray(profile, dtype=np.float64)
        angles = np.arange(segments) * (2.0 * np.pi / segments)
        ring = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
        vertices = [np.array([[0.0, 0.0, outline[0, 1]], [0.0, 0.0, outline[-1, 1]]])]
        for radius, z in outline[1:-1]:
            vertices.append(np.concatenate([radius * ring, np.full((segments, 1), z)], axis=1))
        triangles = []
        n_rings = len(outline) - 2
        for i in range(segments):
            j = (i + 1) % segments
            first, last = 2, 2 + (n_rings - 1) * segments
            triangles.append((0, first + j, first + i))
            triangles.append((1, last + i, last + j))
            for k in range(n_rings - 1):
                a, b = 2 + k * segments, 2 + (k + 1) * segments
                triangles += [(a + i, a + j, b + j), (a + i, b + j, b + i)]
        return cls(np.concatenate(vertices).astype(np.float32), np.array(triangles, dtype=np.int32))

    @classmethod
    def from_obj(cls, path: Path) -> TriangleMesh:
        """The faces of a Wavefront OBJ file, polygons cut into fans."""
        vertices: list[list[float]] = []
        triangles: list[tuple[int, int, int]] = []
        for line in path.read_text().splitlines():
            words = line.split()
            if words[:1] == ["v"]:
                vertices.append([float(v) for v in words[1:4]])
            elif words[:1] == ["f"]:
                corner = [int(w.split("/")[0]) for w in words[1:]]
                corner = [c - 1 if c > 0 else len(vertices) + c for c in corner]
                triangles += [(corner[0], corner[i], corner[i + 1]) for i in range(1, len(corner) - 1)]
        return cls(np.array(vertices, dtype=np.float32), np.array(triangles, dtype=np.int32))
