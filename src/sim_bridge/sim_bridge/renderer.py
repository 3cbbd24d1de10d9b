"""RGB-D images of a world by ray casting (Open3D's Embree scene): colour, z-depth, cast shadows."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
import numpy.typing as npt
import open3d.core as o3c
import pybullet_data
from open3d.t.geometry import RaycastingScene

from cliport_perception import CameraModel, Pose
from sim_bridge.appearance import Appearance
from sim_bridge.colors import rgb
from sim_bridge.image_window import ImageWindow
from sim_bridge.mesh import TriangleMesh
from sim_bridge.visible import Visible

TABLE_X = (-0.3, 0.85)  # the visible sheet, base frame [m]
TABLE_Y = (-0.65, 0.65)
_TABLE_THICKNESS = 0.03  # [m]
_FLOOR_Z = -0.75  # [m]
_FLOOR_HALF = 4.0  # [m]
_LIFT = 5e-4  # shadow rays start this far off the surface [m]


@dataclass(frozen=True, eq=False)
class CleanFrame:
    """A noise-free image: color (H, W, 3) uint8 RGB; depth (H, W) float32 [m] along z, inf where nothing is;
    facing (H, W) float32, cosine between view ray and surface normal, 0 where nothing is."""

    color: npt.NDArray[np.uint8]
    depth: npt.NDArray[np.float32]
    facing: npt.NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class _Triangles:
    """Everything visible as one mesh in the base frame: vertices (N, 3), triangles (M, 3), normals (M, 3),
    color (M, 3) 0..255."""

    vertices: npt.NDArray[np.float32]
    triangles: npt.NDArray[np.uint32]
    normals: npt.NDArray[np.float32]
    color: npt.NDArray[np.float32]


class Renderer:
    """Renders worlds through one camera; the same world gives the same image.

    window: the part of the image that is computed; frames are that large.
    n_threads: 0 uses every core.
    """

    def __init__(self, camera: CameraModel, window: ImageWindow, n_threads: int = 0) -> None:
        self.camera = camera
        self._shape = window.shape
        self._rays_in_camera = np.ascontiguousarray(camera.rays()[window.slices]).reshape(-1, 3)
        lengths = np.linalg.norm(self._rays_in_camera, axis=1, keepdims=True)
        self._unit_rays_in_camera = np.ascontiguousarray((self._rays_in_camera / lengths).T)
        self._n_threads = n_threads

    def render(self, world: Visible, camera_in_base: Pose, appearance: Appearance) -> CleanFrame:
        """What the camera at that pose (optical frame: z forward, x right, y down) sees now."""
        mesh = _collect(world, appearance)
        scene = RaycastingScene(nthreads=self._n_threads)
        scene.add_triangles(o3c.Tensor.from_numpy(mesh.vertices), o3c.Tensor.from_numpy(mesh.triangles))
        rays = np.empty((len(self._rays_in_camera), 6), dtype=np.float32)
        rays[:, :3] = camera_in_base.translation
        np.matmul(self._rays_in_camera, camera_in_base.rotation.T.astype(np.float32), out=rays[:, 3:])
        hits = scene.cast_rays(o3c.Tensor.from_numpy(rays), nthreads=self._n_threads)
        depth = hits["t_hit"].numpy()
        # a miss has the largest id: it becomes the extra last row of every table below
        triangle = np.minimum(hits["primitive_ids"].numpy(), np.uint32(len(mesh.triangles))).astype(np.intp)
        normals = np.append(mesh.normals, np.zeros((1, 3), dtype=np.float32), axis=0)
        facing = self._facing(normals @ camera_in_base.rotation.astype(np.float32), triangle)
        lit, shadow = _shading(mesh, appearance)
        dark = self._shadows(scene, rays, depth, triangle, normals, appearance)
        packed = np.concatenate([lit, shadow]).take(triangle + dark * np.intp(len(lit)))
        color = packed.view(np.uint8).reshape(-1, 4)[:, :3]
        return CleanFrame(color.reshape(*self._shape, 3), depth.reshape(self._shape), facing.reshape(self._shape))

    def _facing(
        self, normals_in_camera: npt.NDArray[np.float32], triangle: npt.NDArray[np.intp]
    ) -> npt.NDArray[np.float32]:
        """(N,) cosine between each ray and the normal (M+1, 3) of the triangle (N,) that it meets."""
        facing = np.zeros(len(triangle), dtype=np.float32)
        for axis in range(3):
            facing += self._unit_rays_in_camera[axis] * normals_in_camera[:, axis].take(triangle)
        return np.abs(facing)

    def _shadows(
        self,
        scene: RaycastingScene,
        rays: npt.NDArray[np.float32],
        depth: npt.NDArray[np.float32],
        triangle: npt.NDArray[np.intp],
        normals: npt.NDArray[np.float32],
        appearance: Appearance,
    ) -> npt.NDArray[np.bool_]:
        """(N,) whether something stands between the pixel's point and the light."""
        to_light = np.array(appearance.to_light, dtype=np.float32)
        reach = np.where(np.isfinite(depth), depth, np.float32(0.0))
        for axis in range(3):  # the rays are spent: they become the probes towards the light
            rays[:, axis] += rays[:, 3 + axis] * reach
            rays[:, axis] += (normals[:, axis] * np.float32(_LIFT)).take(triangle)
            rays[:, 3 + axis] = to_light[axis]
        dark: npt.NDArray[np.bool_] = scene.test_occlusions(
            o3c.Tensor.from_numpy(rays), nthreads=self._n_threads
        ).numpy()
        return dark


def _shading(mesh: _Triangles, appearance: Appearance) -> tuple[npt.NDArray[np.uint32], npt.NDArray[np.uint32]]:
    """Lambert's rule a triangle: packed RGB (M+1,) when lit and when in shadow; the last is the background.

    A triangle that faces away from the light has the same colour in both. Ambient light comes from above.
    """
    cosine = np.clip(mesh.normals @ np.array(appearance.to_light, dtype=np.float32), 0.0, None)
    ambient = appearance.ambient * (0.85 + 0.15 * mesh.normals[:, 2])
    background = np.array([appearance.floor_rgb], dtype=np.float32) * appearance.ambient
    lit = np.concatenate([mesh.color * (ambient + appearance.diffuse * cosine)[:, None], background])
    shadow = np.concatenate([mesh.color * ambient[:, None], background])
    return _packed(lit), _packed(shadow)


def _packed(color: npt.NDArray[np.float32]) -> npt.NDArray[np.uint32]:
    """Colours (N, 3) 0..255 as (N,) words whose first three bytes are R, G, B."""
    words = np.zeros((len(color), 4), dtype=np.uint8)
    words[:, :3] = np.clip(np.rint(color), 0, 255)
    return words.view(np.uint32)[:, 0]


def _collect(world: Visible, appearance: Appearance) -> _Triangles:
    """All meshes of the world at their poses."""
    items: list[tuple[TriangleMesh, Pose, tuple[float, float, float]]] = [
        (mesh, pose, appearance.table_rgb if i == 0 else appearance.floor_rgb) for i, (mesh, pose) in enumerate(_room())
    ]
    items += [(o.mesh, world.object_pose(o), rgb(o.color)) for o in world.objects]
    for link, mesh in _panda_meshes().items():
        index = -1 if link == "panda_link0" else world.panda.link_indices[link]
        items.append((mesh, world.panda.link_pose(index), appearance.robot_rgb))
    vertices = [pose.apply(mesh.vertices).astype(np.float32) for mesh, pose, _ in items]
    offsets = np.cumsum([0] + [len(v) for v in vertices[:-1]])
    triangles = [mesh.triangles + offset for (mesh, _, _), offset in zip(items, offsets, strict=True)]
    color = np.repeat(np.array([c for _, _, c in items], dtype=np.float32), [len(t) for t in triangles], axis=0)
    every_vertex, every_triangle = np.concatenate(vertices), np.concatenate(triangles)
    a, b, c = (every_vertex[every_triangle[:, i]] for i in range(3))
    normals = np.cross(b - a, c - a)
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    return _Triangles(every_vertex, every_triangle.astype(np.uint32), normals.astype(np.float32), color)


@lru_cache(maxsize=1)
def _room() -> tuple[tuple[TriangleMesh, Pose], ...]:
    """The table's sheet, its top at z = 0, and the floor."""
    size = (TABLE_X[1] - TABLE_X[0], TABLE_Y[1] - TABLE_Y[0], _TABLE_THICKNESS)
    middle = (sum(TABLE_X) / 2, sum(TABLE_Y) / 2, -_TABLE_THICKNESS / 2)
    floor = (2 * _FLOOR_HALF, 2 * _FLOOR_HALF, 0.01)
    return (
        (TriangleMesh.box(size), Pose(np.eye(3), np.array(middle))),
        (TriangleMesh.box(floor), Pose(np.eye(3), np.array([0.0, 0.0, _FLOOR_Z]))),
    )


@lru_cache(maxsize=1)
def _panda_meshes() -> dict[str, TriangleMesh]:
    """The arm's coarse meshes in their link frames."""
    folder = Path(pybullet_data.getDataPath()) / "franka_panda" / "meshes" / "collision"
    meshes = {f"panda_{name}": TriangleMesh.from_obj(folder / f"{name}.obj") for name in _PANDA_PARTS}
    finger = TriangleMesh.from_obj(folder / "finger.obj")
    meshes["panda_leftfinger"] = finger
    # the right finger is the left one turned half round about z
    meshes["panda_rightfinger"] = TriangleMesh(
        finger.vertices * np.array([-1, -1, 1], dtype=np.float32), finger.triangles
    )
    return meshes


_PANDA_PARTS = (*(f"link{i}" for i in range(8)), "hand")
