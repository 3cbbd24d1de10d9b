"""What a list of episodes says of each, and the index that keeps it so that a thousand bags need not be opened."""

from __future__ import annotations

import json
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from cliport_episodes.demonstration import PixelBox, Source, StepRecord
from cliport_episodes.disk import replace_text
from cliport_episodes.errors import EpisodeError, RecordError
from cliport_episodes.reader import read_steps
from cliport_perception.pose import PlanarPose
from cliport_perception.primitive import Primitive

FORMAT = 1


@dataclass(frozen=True)
class EpisodeInfo:
    """An episode without its pictures. records: its steps after trim and relabel; bytes: on the disk."""

    name: str
    success: bool | None
    finished: bool
    bytes: int
    complaints: tuple[str, ...]
    records: tuple[StepRecord, ...]

    @property
    def n_steps(self) -> int:
        """How many steps count."""
        return len(self.records)

    @property
    def instructions(self) -> tuple[str, ...]:
        """The different instructions, in the order in which they were first given."""
        return tuple(dict.fromkeys(record.instruction for record in self.records))


class EpisodeIndex:
    """index.json of a data set: a copy of what the bags say, with which files it was made from."""

    def __init__(self, path: Path) -> None:
        self._path = path

    def refresh(self, folders: list[Path]) -> list[EpisodeInfo]:
        """The summaries of episodes' folders, from the index where it is true, else from the bags."""
        known = self._load()
        entries = {}
        for folder in folders:
            with suppress(FileNotFoundError, EpisodeError):  # one that is deleted meanwhile
                signature = _signature(folder)
                entry = known.get(folder.name)
                if entry is None or entry[0] != signature:
                    entry = (signature, _read(folder))
                entries[folder.name] = entry
        if entries != known:
            self._store(entries)
        return [info for _, info in entries.values()]

    def forget(self) -> None:
        """Have everything read from the bags the next time. Raises OSError."""
        self._path.unlink(missing_ok=True)

    def _load(self) -> dict[str, tuple[str, EpisodeInfo]]:
        try:
            document = json.loads(self._path.read_text(encoding="utf-8"))
            if document["format"] != FORMAT:
                return {}
            return {name: (e["files"], _info(name, e)) for name, e in document["episodes"].items()}
        except (OSError, ValueError, KeyError, TypeError, AttributeError, RecordError):
            return {}

    def _store(self, entries: Mapping[str, tuple[str, EpisodeInfo]]) -> None:
        episodes = {name: {"files": files, **asdict(info)} for name, (files, info) in entries.items()}
        with suppress(OSError):  # it saves time, and nothing else
            replace_text(self._path, json.dumps({"format": FORMAT, "episodes": episodes}, ensure_ascii=False))


def _read(folder: Path) -> EpisodeInfo:
    read = read_steps(folder)
    size = sum(file.stat().st_size for file in folder.iterdir() if file.is_file())
    return EpisodeInfo(folder.name, read.edits.success, read.edits.finished, size, read.complaints, read.records)


def _signature(folder: Path) -> str:
    """Changes when a file of the folder does."""
    stats = sorted((file.name, file.stat()) for file in folder.iterdir() if not file.name.startswith("."))
    return " ".join(f"{name}:{stat.st_size}:{stat.st_mtime_ns}" for name, stat in stats)


def _info(name: str, entry: Mapping[str, Any]) -> EpisodeInfo:
    records = tuple(_record(values) for values in entry["records"])
    complaints = tuple(str(line) for line in entry["complaints"])
    return EpisodeInfo(name, entry["success"], bool(entry["finished"]), int(entry["bytes"]), complaints, records)


def _record(values: Mapping[str, Any]) -> StepRecord:
    centroid = values["grasp_centroid"]
    changed = {
        "primitive": Primitive(values["primitive"]),
        "source": Source(values["source"]),
        "pick": PlanarPose(**values["pick"]),
        "place": PlanarPose(**values["place"]),
        "pick_box": values["pick_box"] and PixelBox(**values["pick_box"]),
        "place_box": values["place_box"] and PixelBox(**values["place_box"]),
        "grasp_centroid": None if centroid is None else tuple(centroid),
    }
    return StepRecord(**{**values, **changed})
