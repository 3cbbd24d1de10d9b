"""Triangle meshes of the simulated things, shared by physics and renderer."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
import numpy.typing as npt
from scipy.spatial import ConvexHull

from cliport_core import Pose
from sim_bridge.errors import SimulationError
from sim_bridge.geometry import mesh_files, outlines

_SMALL_MESH = 64  # vertices, up to which all of them serve as the hull's


@dataclass(frozen=True, eq=False)
class TriangleMesh:
    """Mesh of vertices (N, 3) float32 [m] in the body frame and triangles (M, 3) int32, counter-clockwise from outside.

    Its look: colors (M, 3) uint8 RGB a triangle; or texture (H, W, 3) uint8 RGB with uv (M, 3, 2) float32, where
    a triangle's corners lie in it, u to the right and v upwards, 0..1 and repeating. A triangle shows the texture
    where its uv are not NaN, else its own colour, else the colour of the object that has the mesh.

    Raises:
        SimulationError: when shapes do not fit together.
    """

    vertices: npt.NDArray[np.float32]
    triangles: npt.NDArray[np.int32]
    colors: npt.NDArray[np.uint8] | None = None
    uv: npt.NDArray[np.float32] | None = None
    texture: npt.NDArray[np.uint8] | None = None

    def __post_init__(self) -> None:
        n = len(self.triangles)
        if self.colors is not None and self.colors.shape != (n, 3):
            raise SimulationError(f"{n} triangles need colors ({n}, 3), got {self.colors.shape}")
        if (self.uv is None) != (self.texture is None):
            raise SimulationError("a textured mesh needs both: uv and texture")
        if self.uv is not None and self.uv.shape != (n, 3, 2):
            raise SimulationError(f"{n} triangles need uv ({n}, 3, 2), got {self.uv.shape}")

    @cached_property
    def normals(self) -> npt.NDArray[np.float32]:
        """Unit vectors (M, 3) outwards, body frame; zero for a triangle without area."""
        a, b, c = (self.vertices[self.triangles[:, i]].astype(np.float64) for i in range(3))
        normals = np.cross(b - a, c - a)
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-30)
        return normals.astype(np.float32)

    @cached_property
    def box_corners(self) -> npt.NDArray[np.float32]:
        """Corners (8, 3) of the box about it along the body frame's axes [m]."""
        ends = np.stack([self.vertices.min(axis=0), self.vertices.max(axis=0)])
        return np.stack(np.meshgrid(*ends.T), axis=-1).reshape(8, 3)

    @cached_property
    def hull(self) -> npt.NDArray[np.float32]:
        """Vertices (K, 3) with the same convex hull as all of them, fewer where there are many."""
        if len(self.vertices) <= _SMALL_MESH:
            return self.vertices
        return self.vertices[ConvexHull(self.vertices, qhull_options="QJ").vertices]  # QJ: takes flat things too

    def texels(
        self, triangle: npt.NDArray[np.intp], weights: npt.NDArray[np.float32]
    ) -> tuple[npt.NDArray[np.uint8], npt.NDArray[np.bool_]]:
        """Return the texture's nearest RGB (K, 3) at points of triangles (K,), and where there is one (K,).

        weights (K, 2): of the second and third corner.
        """
        if self.uv is None or self.texture is None:
            raise SimulationError("this mesh has no texture")
        corners = self.uv.take(triangle, axis=0)
        w1, w2 = weights[:, :1], weights[:, 1:]
        u, v = (corners[:, 0] * (1 - w1 - w2) + corners[:, 1] * w1 + corners[:, 2] * w2).T
        known = np.isfinite(u) & np.isfinite(v)
        height, width = self.texture.shape[:2]
        col = np.floor(np.where(known, u, 0.0) * width).astype(np.intp) % width
        row = np.floor(np.where(known, 1.0 - v, 0.0) * height).astype(np.intp) % height
        return self.texture[row, col], known

    @classmethod
    def box(cls, size: tuple[float, float, float]) -> TriangleMesh:
        """Return a box of `size` (x, y, z) [m] about the origin."""
        corners = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
        quads = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
        triangles = [t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))]
        return cls((corners * size).astype(np.float32), np.array(triangles, dtype=np.int32))

    @classmethod
    def revolved(cls, profile: npt.ArrayLike, segments: int) -> TriangleMesh:
        """Return a closed outline of (radius, z) pairs [m], turned about z.

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
    def extruded(cls, outline: npt.ArrayLike, height: float, holes: Sequence[npt.ArrayLike] = ()) -> TriangleMesh:
        """Return a prism over a polygon: its base at z = 0, its top at z = height [m].

        outline (N, 2) and each hole (K, 2): corners [m] in order, clockwise or not, the first not repeated at the
        end. They must not cross themselves or one another, and holes lie inside the outline.

        Raises:
            SimulationError: when an outline has no area, a hole lies outside, or the height is not positive.
        """
        if not height > 0.0:
            raise SimulationError(f"a prism needs a height above 0, got {height} m")
        rings = outlines.oriented(outline, holes)
        flat = np.concatenate(rings)
        n = len(flat)
        vertices = np.column_stack([np.tile(flat, (2, 1)), np.repeat([0.0, height], n)])
        cap = outlines.triangulated(rings)
        starts = np.cumsum([0, *(len(ring) for ring in rings[:-1])])
        here = np.arange(n)
        there = np.concatenate([np.roll(start + np.arange(len(ring)), -1) for start, ring in zip(starts, rings)])
        walls = [np.stack([here, there, there + n], axis=1), np.stack([here, there + n, here + n], axis=1)]
        triangles = np.concatenate([cap[:, ::-1], cap + n, *walls])
        return cls(vertices.astype(np.float32), triangles.astype(np.int32))

    @classmethod
    def joined(cls, meshes: Sequence[TriangleMesh]) -> TriangleMesh:
        """Join meshes to one; they keep their colours and texture.

        Raises:
            SimulationError: when some have colours and others neither colours nor a texture, or two have textures.
        """
        offsets = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes[:-1])])
        triangles = [mesh.triangles + np.int32(offset) for mesh, offset in zip(meshes, offsets)]
        return cls(
            np.concatenate([mesh.vertices for mesh in meshes]),
            np.concatenate(triangles),
            _joined_colors(meshes),
            *_joined_texture(meshes),
        )

    @classmethod
    def from_obj(cls, path: Path, texture: Path | None = None) -> TriangleMesh:
        """Read the faces of a Wavefront OBJ file, polygons cut into fans, with its texture, if it has one.

        The texture is the image at `texture`, else the map_Kd of the material file that the OBJ names, else the PNG
        of the same name beside it.

        Raises:
            SimulationError: when the file is missing or is no such file.
        """
        return cls(*mesh_files.read_obj(path, texture))

    @classmethod
    def from_ply(cls, path: Path) -> TriangleMesh:
        """Read the triangles of a PLY file; colours of its vertices, if it has them, are averaged over each triangle.

        Raises:
            SimulationError: when the file is missing or holds no triangles.
        """
        return cls(*mesh_files.read_ply(path))

    def transformed(self, pose: Pose | None = None, scale: float | Sequence[float] = 1.0) -> TriangleMesh:
        """Return the mesh scaled about the origin, by one factor or one for each axis,
        then moved; a mirror image faces outwards too."""
        vertices = (pose or Pose.identity()).apply(self.vertices * np.asarray(scale, dtype=np.float64))
        order = slice(None, None, -1 if np.prod(np.broadcast_to(scale, 3)) < 0.0 else 1)
        uv = None if self.uv is None else self.uv[:, order]
        return replace(self, vertices=vertices.astype(np.float32), triangles=self.triangles[:, order], uv=uv)

    def colored(self, rgb: npt.ArrayLike) -> TriangleMesh:
        """Return the same shape in one colour, 0..255 RGB (3,), or in a colour
        for each triangle (M, 3), without texture."""
        colors = np.broadcast_to(np.asarray(rgb, dtype=np.uint8), (len(self.triangles), 3)).copy()
        return TriangleMesh(self.vertices, self.triangles, colors)


def _joined_colors(meshes: Sequence[TriangleMesh]) -> npt.NDArray[np.uint8] | None:
    if all(mesh.colors is None for mesh in meshes):
        return None
    if any(mesh.colors is None and mesh.texture is None for mesh in meshes):
        raise SimulationError("some parts have colours and others none: give those theirs with colored()")
    none = np.zeros(3, dtype=np.uint8)  # never seen: such a part shows its texture
    return np.concatenate([np.broadcast_to(none, m.triangles.shape) if m.colors is None else m.colors for m in meshes])


def _joined_texture(
    meshes: Sequence[TriangleMesh],
) -> tuple[npt.NDArray[np.float32] | None, npt.NDArray[np.uint8] | None]:
    textures = {id(mesh.texture): mesh.texture for mesh in meshes if mesh.texture is not None}
    if not textures:
        return None, None
    if len(textures) > 1:
        raise SimulationError(f"a mesh has one texture, got {len(textures)}: put them into one image")
    untextured = [np.full((len(mesh.triangles), 3, 2), np.nan, dtype=np.float32) for mesh in meshes]
    uv = [nan if mesh.uv is None else mesh.uv for mesh, nan in zip(meshes, untextured)]
    return np.concatenate(uv), next(iter(textures.values()))
