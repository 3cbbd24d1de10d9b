"""Reads a folder of Google Scanned Objects: the benchmark's release (OBJ and PNG), or PLY meshes."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt

from sim_bridge.errors import ObjectFolderError, SimulationError
from sim_bridge.everyday import google_names
from sim_bridge.everyday.decomposition import convex_pieces
from sim_bridge.everyday.everyday_object import EverydayObject
from sim_bridge.geometry.mesh import TriangleMesh

_COLORS = {**google_names.SEEN, **google_names.UNSEEN}
_TEXTURE_SIZE = 512  # pixels of the longer side
_SUFFIXES = (".ply", ".obj")  # the later is preferred: it has a texture


def find(folder: Path, named_by: str) -> dict[str, Path]:
    """Find mesh files of the benchmark's objects by name, in the folder or below; named_by: what names the folder.

    Raises:
        ObjectFolderError: when there is no such folder, or it holds none of them.
    """
    if not folder.is_dir():
        raise ObjectFolderError(
            f"{named_by}={folder} is no folder: name one with the benchmark's Google objects, or unset it for the "
            "project's own objects"
        )
    found: dict[str, Path] = {}
    for suffix in _SUFFIXES:
        for path in sorted(folder.rglob(f"*{suffix}")):
            name = path.stem.replace("_", " ")
            if name in _COLORS:
                found[name] = path
    if not found:
        raise ObjectFolderError(
            f"{named_by}={folder} holds no object of the benchmark, such as alarm_clock.ply or alarm_clock.obj: name "
            "another folder, or unset it for the project's own objects"
        )
    return found


def load(name: str, path: Path) -> EverydayObject:
    """Load the object in a mesh file, with its texture or colours, else in the colour that goes with its name.

    Raises:
        ObjectFolderError: when the file cannot be used.
    """
    try:
        mesh = TriangleMesh.from_obj(path, _texture_of(path)) if path.suffix == ".obj" else TriangleMesh.from_ply(path)
        if mesh.texture is not None and max(mesh.texture.shape) > _TEXTURE_SIZE:
            mesh = replace(mesh, texture=_smaller(mesh.texture))
        elif mesh.texture is None and mesh.colors is None:
            mesh = mesh.colored(_COLORS[name])
        return EverydayObject.centred(name, mesh, convex_pieces(mesh))
    except SimulationError as error:
        raise ObjectFolderError(f"cannot use {path} as the {name}: {error}; replace the file or remove it") from error


def _smaller(image: npt.NDArray[np.uint8]) -> npt.NDArray[np.uint8]:
    """Return a texture as sharp as the camera can see, and small enough for fifty of them."""
    factor = _TEXTURE_SIZE / max(image.shape)
    return np.asarray(cv2.resize(image, None, fx=factor, fy=factor, interpolation=cv2.INTER_AREA), dtype=np.uint8)


def _texture_of(path: Path) -> Path | None:
    """Return the PNG of the same name: beside the mesh, or in a folder next to its folder."""
    nearby = [path.with_suffix(".png"), *sorted(path.parent.parent.glob(f"*/{path.stem}.png"))]
    return next((image for image in nearby if image.is_file()), None)
