"""Reads triangle meshes from Wavefront OBJ files, with their texture, and from PLY files."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np
import numpy.typing as npt

from sim_bridge.errors import SimulationError


class MeshArrays(NamedTuple):
    """The fields of a `TriangleMesh`, which says what they are."""

    vertices: npt.NDArray[np.float32]
    triangles: npt.NDArray[np.int32]
    colors: npt.NDArray[np.uint8] | None = None
    uv: npt.NDArray[np.float32] | None = None
    texture: npt.NDArray[np.uint8] | None = None


def read_obj(path: Path, texture: Path | None = None) -> MeshArrays:
    """Read a Wavefront OBJ file; arguments and errors as of TriangleMesh.from_obj."""
    places: list[list[float]] = []
    texture_places: list[list[float]] = []
    corners: list[tuple[int, int]] = []  # of triangle after triangle: rows of the two lists, -1 for none
    material: Path | None = None
    try:
        for line in path.read_text().splitlines():
            words = line.split()
            if words[:1] == ["v"]:
                places.append([float(v) for v in words[1:4]])
            elif words[:1] == ["vt"]:
                texture_places.append([float(v) for v in words[1:3]])
            elif words[:1] == ["f"]:
                face = [_corner(word, len(places), len(texture_places)) for word in words[1:]]
                corners += [face[k] for i in range(1, len(face) - 1) for k in (0, i, i + 1)]
            elif words[:1] == ["mtllib"]:
                material = path.parent / line.split(maxsplit=1)[1].strip()
        vertices = np.array(places, dtype=np.float32).reshape(-1, 3)
        index = np.array(corners, dtype=np.int32).reshape(-1, 3, 2)
    except (OSError, ValueError, IndexError) as error:
        raise SimulationError(f"cannot read {path} as an OBJ file: {error}") from error
    if not len(index) or index[..., 0].max() >= len(vertices) or index.min() < -1:
        raise SimulationError(f"{path} holds no faces, or faces of vertices that it does not have")
    image = _texture(path, material, texture) if (index[..., 1] >= 0).all() and texture_places else None
    if image is None:
        return MeshArrays(vertices, index[..., 0].copy())
    uv = np.array(texture_places, dtype=np.float32)[index[..., 1]]
    return MeshArrays(vertices, index[..., 0].copy(), uv=uv, texture=image)


def read_ply(path: Path) -> MeshArrays:
    """Read a PLY file; arguments and errors as of TriangleMesh.from_ply."""
    import open3d  # slow to import, and physics does without

    try:
        with path.open("rb") as file:
            is_ply = file.read(3) == b"ply"
    except OSError as error:
        raise SimulationError(f"cannot read {path}: {error}") from error
    with open3d.utility.VerbosityContextManager(open3d.utility.VerbosityLevel.Error):
        mesh = open3d.io.read_triangle_mesh(path) if is_ply else open3d.geometry.TriangleMesh()
    triangles = np.asarray(mesh.triangles).astype(np.int32)
    if not len(triangles) or triangles.max() >= len(mesh.vertices):
        raise SimulationError(f"{path} holds no triangles, or triangles of vertices that it does not have")
    colors = None
    if mesh.has_vertex_colors():
        mean = np.asarray(mesh.vertex_colors)[triangles].mean(axis=1)
        colors = np.rint(255.0 * mean).astype(np.uint8)
    return MeshArrays(np.asarray(mesh.vertices).astype(np.float32), triangles, colors)


def _corner(word: str, n_places: int, n_texture_places: int) -> tuple[int, int]:
    """Return the rows of one corner `v`, `v/vt` or `v/vt/vn`, which count from 1, or from the end when negative."""
    place, texture_place = (*word.split("/"), "")[:2]
    v, vt = int(place), int(texture_place or 0)
    return (v - 1 if v > 0 else n_places + v), (vt - 1 if vt >= 0 else n_texture_places + vt)


def _texture(path: Path, material: Path | None, chosen: Path | None) -> npt.NDArray[np.uint8] | None:
    """Return the RGB image that belongs to an OBJ file."""
    image_path = chosen or path.with_suffix(".png")
    if chosen is None and material is not None and material.is_file():
        for line in material.read_text().splitlines():
            words = line.split(maxsplit=1)
            if len(words) == 2 and words[0] == "map_Kd":
                image_path = material.parent / words[1].strip()
    if not image_path.is_file():
        return None
    image = cv2.imread(str(image_path), cv2.IMREAD_COLOR_RGB)
    if image is None:
        raise SimulationError(f"cannot read {image_path}, the texture of {path.name}, as an image")
    return np.asarray(image, dtype=np.uint8)
