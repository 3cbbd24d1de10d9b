"""Parts at which rays are cast (Open3D's Embree scenes): many small bodies as one, or a large or textured one alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import open3d.core as o3c
from open3d.t.geometry import RaycastingScene

from cliport_core import Pose
from sim_bridge.geometry.mesh import TriangleMesh
from sim_bridge.rendering.appearance import Appearance
from sim_bridge.rendering.backdrop import TABLE_TRIANGLES, backdrop_colors, backdrop_mesh
from sim_bridge.rendering.bodies import Body
from sim_bridge.rendering.rays import Rays, dot, turned

_LARGE_MESH = 1000  # triangles from which on a mesh's search tree is worth keeping from frame to frame


class Struck(NamedTuple):
    """Rays that meet a part, by their rows (K,): at which depth (K,) [m], the
    surface's own normal (K, 3), base frame, and colour (K, 3)."""

    rows: npt.NDArray[np.intp]
    depth: npt.NDArray[np.float32]
    normal: npt.NDArray[np.float32]
    color: npt.NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Part:
    """M triangles with normals and colors (M, 3): of one mesh alone, in its
    own frame, or of several, in the base frame.

    pose: of that frame in the base frame. table: the look of the table that is its first triangles, where that has a
    texture.
    """

    scene: RaycastingScene
    pose: Pose
    normals: npt.NDArray[np.float32]
    colors: npt.NDArray[np.float32]
    alone: TriangleMesh | None
    n_threads: int
    table: Appearance | None = None

    def strike(self, rays: Rays, nearer_than: npt.NDArray[np.float32]) -> Struck:
        """Return those of K rays that meet it at a depth below (K,) [m]."""
        rows = self._near_rays(rays)
        origin, directions = self._points(rays.origin[None]), self._directions(rays.directions.take(rows, axis=0))
        found = self.scene.cast_rays(_tensor(origin, directions), nthreads=self.n_threads)
        depth = found["t_hit"].numpy()
        first = np.flatnonzero(depth < nearer_than.take(rows))
        triangle = found["primitive_ids"].numpy().take(first).astype(np.intp)
        color, normal = self.colors.take(triangle, axis=0), self.normals.take(triangle, axis=0)
        if self.alone is not None and self.alone.texture is not None:
            texels, known = self.alone.texels(triangle, found["primitive_uvs"].numpy().take(first, axis=0))
            color[known] = texels[known]
        if self.table is not None:
            on_table = np.flatnonzero(triangle < TABLE_TRIANGLES)
            points = rays.take(rows.take(first).take(on_table)).points(depth.take(first).take(on_table))
            color[on_table] = self.table.table_colors(points)
        if self.alone is not None:
            normal = turned(normal, self.pose.rotation)
        return Struck(rows.take(first), depth.take(first), normal, color)

    def blocks(self, points: npt.NDArray[np.float32], to_light: npt.NDArray[np.float32]) -> npt.NDArray[np.bool_]:
        """Return (K,) whether it stands between points (K, 3) [m] and the light."""
        blocked = np.zeros(len(points), dtype=bool)
        rows = self._near_probes(points, to_light)
        probes = _tensor(self._points(points.take(rows, axis=0)), self._directions(to_light[None]))
        blocked[rows] = self.scene.test_occlusions(probes, nthreads=self.n_threads).numpy()
        return blocked

    def _points(self, points: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
        """Return points (K, 3) of the base frame in the own one."""
        return self._directions(points - self.pose.translation.astype(np.float32))

    def _directions(self, directions: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
        """Return directions (K, 3) of the base frame in the own one."""
        return directions if self.alone is None else turned(directions, self.pose.rotation.T)

    def _near_rays(self, rays: Rays) -> npt.NDArray[np.intp]:
        """Return the rows of rays whose lines pass through a ball about it."""
        if self.alone is None:
            return np.arange(len(rays.lengths))
        middle, radius = _ball(self.alone, self.pose)
        offset = middle - rays.origin
        along = dot(rays.directions, offset)
        return np.flatnonzero(along * along >= (offset @ offset - radius * radius) * rays.lengths * rays.lengths)

    def _near_probes(self, points: npt.NDArray[np.float32], to_light: npt.NDArray[np.float32]) -> npt.NDArray[np.intp]:
        """Return the rows of points whose lines to the light pass through that ball."""
        if self.alone is None:
            return np.arange(len(points))
        middle, radius = _ball(self.alone, self.pose)
        offset = middle - points
        along = dot(offset, to_light)
        return np.flatnonzero(dot(offset, offset) - along * along <= radius * radius)


def parts_of(bodies: Sequence[Body], appearance: Appearance, n_threads: int) -> list[Part]:
    """Return the backdrop with all small bodies as one part, then the others."""
    apart = [len(body.mesh.triangles) >= _LARGE_MESH or body.mesh.texture is not None for body in bodies]
    together = [body for body, alone in zip(bodies, apart) if not alone]
    vertices, normals = [backdrop_mesh().vertices], [backdrop_mesh().normals]
    triangles, colors = [backdrop_mesh().triangles], [backdrop_colors(appearance)]
    n_vertices = len(vertices[0])
    for body in together:
        vertices.append(body.pose.apply(body.mesh.vertices).astype(np.float32))
        normals.append(turned(body.mesh.normals, body.pose.rotation))
        triangles.append(body.mesh.triangles + np.int32(n_vertices))
        colors.append(_colors(body))
        n_vertices += len(body.mesh.vertices)
    scene = _scene(np.concatenate(vertices), np.concatenate(triangles), n_threads)
    table = None if appearance.table_texture is None else appearance
    parts = [Part(scene, Pose.identity(), np.concatenate(normals), np.concatenate(colors), None, n_threads, table)]
    for body, alone in zip(bodies, apart):
        if alone:
            scene = _kept_scene(body.mesh, n_threads)
            parts.append(Part(scene, body.pose, body.mesh.normals, _colors(body), body.mesh, n_threads))
    return parts


def _colors(body: Body) -> npt.NDArray[np.float32]:
    """Return the colours of the triangles, (M, 3), textures apart."""
    own = body.rgb if body.mesh.colors is None else body.mesh.colors
    return np.broadcast_to(np.asarray(own, dtype=np.float32), body.mesh.triangles.shape)


def _ball(mesh: TriangleMesh, pose: Pose) -> tuple[npt.NDArray[np.float32], np.float32]:
    """Return middle (3,) and radius [m], base frame, of a ball about a mesh at a pose."""
    low, high = mesh.box_corners[0], mesh.box_corners[-1]
    return pose.apply((low + high) / 2).astype(np.float32), np.float32(1.001 * np.linalg.norm(high - low) / 2)


@lru_cache(maxsize=32)
def _kept_scene(mesh: TriangleMesh, n_threads: int) -> RaycastingScene:
    return _scene(mesh.vertices, mesh.triangles, n_threads)


def _scene(vertices: npt.NDArray[np.float32], triangles: npt.NDArray[np.int32], n_threads: int) -> RaycastingScene:
    scene = RaycastingScene(nthreads=n_threads)
    scene.add_triangles(o3c.Tensor.from_numpy(vertices), o3c.Tensor.from_numpy(triangles.astype(np.uint32, order="C")))
    return scene


def _tensor(origins: npt.NDArray[np.float32], directions: npt.NDArray[np.float32]) -> o3c.Tensor:
    """Return Open3D's rays (K, 6), of (K, 3) and (1, 3) or the other way round."""
    n, _ = np.broadcast_shapes(origins.shape, directions.shape)
    rays = np.empty((n, 6), dtype=np.float32)
    rays[:, :3] = origins
    rays[:, 3:] = directions
    return o3c.Tensor.from_numpy(rays)
