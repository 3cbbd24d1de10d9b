"""The set of everyday objects that the packing tasks use: the project's own, or a folder of Google Scanned Objects."""

from __future__ import annotations

import os
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Protocol

from sim_bridge.errors import ObjectFolderError
from sim_bridge.everyday import catalogue, google_folder, google_names
from sim_bridge.everyday.everyday_object import EverydayObject
from sim_bridge.geometry.mesh import TriangleMesh

FOLDER_VARIABLE = "CLIPORT_GOOGLE_OBJECTS"
FEWEST = 9  # names that a scene may need


class _Maker(Protocol):
    def __call__(self, name: str) -> EverydayObject: ...


@dataclass(frozen=True, eq=False)
class ObjectSet:
    """Set of objects. seen, unseen: names of those for training and of the
    others; description: for results and logs."""

    description: str
    seen: tuple[str, ...]
    unseen: tuple[str, ...]
    make: _Maker

    def named(self, name: str) -> EverydayObject:
        """Return the object of that name; made once in each process."""
        return _made(self, name)


def object_set() -> ObjectSet:
    """Return the set in use: that in the folder which CLIPORT_GOOGLE_OBJECTS names, if it does, else the project's own.

    Raises:
        ObjectFolderError: when the folder is missing or not usable.
    """
    folder = os.environ.get(FOLDER_VARIABLE, "").strip()
    return _from_folder(folder) if folder else _own()


def describe() -> str:
    """Return the name under which results list the set in use, such as "own-56".

    Raises:
        ObjectFolderError: when the folder is missing or not usable.
    """
    return object_set().description


@cache
def _own() -> ObjectSet:
    things = {**catalogue.SEEN, **catalogue.UNSEEN}

    def make(name: str) -> EverydayObject:
        mesh = TriangleMesh.joined([part.mesh() for part in things[name]])
        return EverydayObject.centred(name, mesh, [hull for part in things[name] for hull in part.hulls()])

    return ObjectSet(f"own-{len(things)}", tuple(catalogue.SEEN), tuple(catalogue.UNSEEN), make)


@cache
def _from_folder(folder: str) -> ObjectSet:
    files = google_folder.find(Path(folder), FOLDER_VARIABLE)
    seen, unseen = (tuple(n for n in names if n in files) for names in (google_names.SEEN, google_names.UNSEEN))
    missing = [n for n in (*google_names.SEEN, *google_names.UNSEEN) if n not in files]
    if min(len(seen), len(unseen)) < FEWEST:
        raise ObjectFolderError(
            f"{FOLDER_VARIABLE}={folder} lacks {len(missing)} of the 56 objects ({', '.join(missing[:3])}, ...): "
            "name a folder with a PLY, or an OBJ and a PNG, of each, or unset it for the project's own objects"
        )
    kind = "OBJ" if any(path.suffix == ".obj" for path in files.values()) else "PLY"
    count = len(seen) + len(unseen)
    without = f", without {', '.join(missing)}" if missing else ""
    description = f"google {kind} folder, {count} of 56{without}"
    return ObjectSet(description, seen, unseen, lambda name: google_folder.load(name, files[name]))


@cache
def _made(source: ObjectSet, name: str) -> EverydayObject:
    return source.make(name)
