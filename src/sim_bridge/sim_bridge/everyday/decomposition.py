"""Convex pieces of any mesh, by PyBullet's V-HACD, kept in the user's cache directory."""

from __future__ import annotations

import hashlib
import logging
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import numpy.typing as npt
from scipy.spatial import ConvexHull, QhullError

from cliport_core.whole_file import whole_file
from sim_bridge.everyday.merging import merged
from sim_bridge.geometry.mesh import TriangleMesh
from sim_bridge.geometry.surface import surface_points

FloatArray = npt.NDArray[np.float64]

_VERSION = 1  # of the files in the cache: count up when the pieces would be others
_RESOLUTION = 50_000  # voxels
_CONCAVITY = 0.002
_CORNERS = 32  # of V-HACD's pieces, at most
_SURFACE = 20_000  # points by which a surface is known
_TIME_LIMIT = 120.0  # [s]
# In a process of its own: V-HACD writes pages to the standard output, and a mesh may bring it down.
_PROGRAM = (
    "import sys, pybullet; pybullet.vhacd(*sys.argv[1:4], resolution=int(sys.argv[4]), concavity=float(sys.argv[5]), "
    "maxNumVerticesPerCH=int(sys.argv[6]))"
)

_log = logging.getLogger(__name__)


def convex_pieces(mesh: TriangleMesh) -> list[FloatArray]:
    """Return corners (N, 3) [m] of convex pieces that together are about the
    mesh; of its convex hull where that fails."""
    path = _cache_folder() / f"{_key(mesh)}.npz"
    try:
        with np.load(path, allow_pickle=False) as stored:
            return [np.asarray(stored[f"piece{i}"], dtype=np.float64) for i in range(len(stored.files))]
    except (OSError, ValueError, KeyError):
        pieces = _decomposed(mesh)
        _store(path, pieces)
        return pieces


def _decomposed(mesh: TriangleMesh) -> list[FloatArray]:
    settings = [str(value) for value in (_RESOLUTION, _CONCAVITY, _CORNERS)]
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        source, result, log = folder / "mesh.obj", folder / "pieces.obj", folder / "log.txt"
        lines = [f"v {x:.7g} {y:.7g} {z:.7g}" for x, y, z in mesh.vertices.tolist()]
        lines += [f"f {a} {b} {c}" for a, b, c in (mesh.triangles + 1).tolist()]
        source.write_text("\n".join(lines) + "\n")
        command = [sys.executable, "-c", _PROGRAM, str(source), str(result), str(log), *settings]
        try:
            subprocess.run(command, check=True, capture_output=True, timeout=_TIME_LIMIT)
            pieces = merged(_tightened(_read(result), mesh))
        except (OSError, subprocess.SubprocessError, ValueError) as error:
            _log.warning("a mesh of %d triangles collides as its convex hull: %s", len(mesh.triangles), error)
            return [mesh.vertices.astype(np.float64)]
    return pieces or [mesh.vertices.astype(np.float64)]


def _tightened(pieces: list[FloatArray], mesh: TriangleMesh) -> list[FloatArray]:
    """Return V-HACD's pieces, which are a voxel too large, cut down to the hulls of the surface's points in each."""
    surface = np.concatenate([surface_points(mesh, _SURFACE), mesh.vertices])
    tight = []
    for piece in pieces:
        faces = ConvexHull(piece).equations
        inside = surface[(surface @ faces[:, :3].T + faces[:, 3] <= 1e-6).all(axis=1)]
        if len(inside) == 0:
            continue
        corners = inside[np.unique(np.argmax(inside @ _DIRECTIONS.T, axis=0))]
        try:
            ConvexHull(corners)
        except (QhullError, ValueError):
            continue  # a sliver
        tight.append(corners)
    return tight


def _read(path: Path) -> list[FloatArray]:
    """Read the vertices of each object in a Wavefront file."""
    pieces: list[list[list[float]]] = []
    for line in path.read_text().splitlines():
        kind, *words = line.split() or [""]
        if kind == "o":
            pieces.append([])
        elif kind == "v":
            pieces[-1].append([float(word) for word in words])
    return [np.array(piece) for piece in pieces if len(piece) > 3]


def _even_directions(count: int) -> FloatArray:
    """Return (count, 3) unit vectors, evenly over the sphere (a Fibonacci lattice)."""
    z = 1.0 - (2.0 * np.arange(count) + 1.0) / count
    angle = np.arange(count) * (np.pi * (3.0 - np.sqrt(5.0)))
    ring = np.sqrt(1.0 - z * z)
    return np.column_stack([ring * np.cos(angle), ring * np.sin(angle), z])


_DIRECTIONS = _even_directions(48)  # in which the corners of a piece are looked for


def _key(mesh: TriangleMesh) -> str:
    content = hashlib.sha256(repr((_VERSION, _RESOLUTION, _CONCAVITY, _CORNERS)).encode())
    content.update(np.ascontiguousarray(mesh.vertices).tobytes())
    content.update(np.ascontiguousarray(mesh.triangles).tobytes())
    return content.hexdigest()[:32]


def _cache_folder() -> Path:
    base = os.environ.get("XDG_CACHE_HOME") or str(Path.home() / ".cache")
    return Path(base) / "cliport-ros" / "convex-pieces"


def _store(path: Path, pieces: list[FloatArray]) -> None:
    """Store pieces whole or not at all, so that other processes never read half a file."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with whole_file(path) as temporary, temporary.open("wb") as file:
            np.savez(file, **{f"piece{i}": piece for i, piece in enumerate(pieces)})  # type: ignore[arg-type]
    except OSError as error:
        _log.warning("convex pieces are not kept for the next time: %s", error)
