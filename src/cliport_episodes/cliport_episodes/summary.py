"""Summaries of episodes, and the index that keeps them so that a thousand bags need not be opened."""

from __future__ import annotations

import json
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from cliport_core.action import PickPlaceAction, Primitive
from cliport_core.outcome import ActionResult, Outcome, Refusal
from cliport_core.pose import PlanarPose
from cliport_episodes.demonstration import PixelBox, Source, StepRecord
from cliport_episodes.disk import replace_text
from cliport_episodes.errors import EpisodeError, RecordError
from cliport_episodes.reader import read_steps

FORMAT = 2


@dataclass(frozen=True)
class EpisodeInfo:
    """An episode without its pictures; records: its steps after trimming and relabelling; bytes: on the disk."""

    name: str
    success: bool | None
    finished: bool
    bytes: int
    complaints: tuple[str, ...]
    records: tuple[StepRecord, ...]

    @property
    def n_steps(self) -> int:
        """Number of steps that count."""
        return len(self.records)

    @property
    def instructions(self) -> tuple[str, ...]:
        """Distinct instructions, in the order in which they were first given."""
        return tuple(dict.fromkeys(record.instruction for record in self.records))


class EpisodeIndex:
    """index.json of a data set: a copy of the bags' records, with the signatures of the files it was made from."""

    def __init__(self, path: Path) -> None:
        self._path = path

    def refresh(self, folders: list[Path]) -> list[EpisodeInfo]:
        """Return the summaries of episodes' folders, from the index where it is up to date, else from the bags."""
        known = self._load()
        entries = {}
        for folder in folders:
            with suppress(FileNotFoundError, EpisodeError):  # an episode that is deleted meanwhile
                signature = _signature(folder)
                entry = known.get(folder.name)
                if entry is None or entry[0] != signature:
                    entry = (signature, _read(folder))
                entries[folder.name] = entry
        if entries != known:
            self._store(entries)
        return [info for _, info in entries.values()]

    def forget(self) -> None:
        """Delete the index, so that the next `refresh` reads the bags. Raises OSError."""
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
        with suppress(OSError):  # the index only saves time
            replace_text(self._path, json.dumps({"format": FORMAT, "episodes": episodes}, ensure_ascii=False))


def _read(folder: Path) -> EpisodeInfo:
    read = read_steps(folder)
    size = sum(file.stat().st_size for file in folder.iterdir() if file.is_file())
    return EpisodeInfo(folder.name, read.edits.success, read.edits.finished, size, read.complaints, read.records)


def _signature(folder: Path) -> str:
    """Return a text that changes whenever a file of the folder does."""
    stats = sorted((file.name, file.stat()) for file in folder.iterdir() if not file.name.startswith("."))
    return " ".join(f"{name}:{stat.st_size}:{stat.st_mtime_ns}" for name, stat in stats)


def _info(name: str, entry: Mapping[str, Any]) -> EpisodeInfo:
    records = tuple(_record(values) for values in entry["records"])
    complaints = tuple(str(line) for line in entry["complaints"])
    return EpisodeInfo(name, entry["success"], bool(entry["finished"]), int(entry["bytes"]), complaints, records)


def _record(values: Mapping[str, Any]) -> StepRecord:
    changed = {
        "source": Source(values["source"]),
        "action": _action(values["action"]),
        "result": values["result"] and _result(values["result"]),
        "pick_box": values["pick_box"] and PixelBox(**values["pick_box"]),
        "place_box": values["place_box"] and PixelBox(**values["place_box"]),
    }
    return StepRecord(**{**values, **changed})


def _action(values: Mapping[str, Any]) -> PickPlaceAction:
    pick, place = PlanarPose(**values["pick"]), PlanarPose(**values["place"])
    return PickPlaceAction(**{**values, "pick": pick, "place": place, "primitive": Primitive(values["primitive"])})


def _result(values: Mapping[str, Any]) -> ActionResult:
    centroid = values["grasp_centroid"] and tuple(values["grasp_centroid"])
    changed = {
        "outcome": Outcome(values["outcome"]),
        "refusal": Refusal(values["refusal"]),
        "grasp_centroid": centroid,
    }
    return ActionResult(**{**values, **changed})
