"""Finished episodes of an evaluation on disk, a JSON line each, so that an interrupted one goes on where it stopped."""

from __future__ import annotations

import json
import os
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from cliport_benchmark.episode import Episode
from cliport_benchmark.errors import DataFolderError, OptionError
from cliport_benchmark.json_files import as_json, differences, read_json

_SAID_WHERE_UNUSUAL = ("wording", "graph", "survey_colors", "camera_kind", "without_arm")  # settings


@dataclass(frozen=True)
class Discarded:
    """A scene that is worth nothing, and why: no layout was found, or its objects flew apart."""

    seed: int
    reason: str


@dataclass(frozen=True)
class GraphEpisode:
    """One scene's outcome through the graph; score 0..1. instructions: what was said, in order. message: the policy's
    last. wall_s: wall time [s]. redraws, broken: as Episode's."""

    seed: int
    score: float
    steps: int
    instructions: tuple[str, ...]
    message: str
    wall_s: float
    redraws: int = 0
    broken: bool = False

    @classmethod
    def from_dict(cls, values: dict[str, Any]) -> GraphEpisode:
        """Return the episode that dataclasses.asdict made a dict of, also after JSON made a list of the tuple."""
        return cls(**{**values, "instructions": tuple(values["instructions"])})


Outcome = Episode | GraphEpisode | Discarded


class Journal:
    """The file beside an evaluation's results: the settings, then an outcome a line.

    A line is written as a whole; of a run that was killed, at most the episode in progress is lost. The file
    appears with the first outcome. Results that are there already, of the same settings, are gone on with.

    Raises:
        OptionError: when it was begun with other settings, or is no such file.
        DataFolderError: when the results are of other settings, or no results.
    """

    def __init__(self, out: Path, settings: dict[str, Any]) -> None:
        self.out, self.settings = out, as_json(settings)
        self.path = out.with_suffix(".episodes.jsonl")
        self.outcomes: dict[int, Outcome] = {}
        if self.path.exists():
            self._read()
        if out.exists():
            self.outcomes = self._results() | self.outcomes

    def add(self, outcome: Outcome) -> None:
        """Keep one more outcome, on disk when this returns."""
        self.outcomes[outcome.seed] = outcome
        lines = [json.dumps({_kind(outcome): asdict(outcome)})]
        if not self.path.exists():
            lines.insert(0, json.dumps({"settings": self.settings}))
        try:
            with self.path.open("a", encoding="utf-8") as file:
                file.write("\n".join(lines) + "\n")
                file.flush()
                os.fsync(file.fileno())
        except OSError as error:
            raise DataFolderError(f"cannot write {self.path}: {error.strerror or error}") from error

    def remove(self) -> None:
        """The results are written: the next run begins anew."""
        self.path.unlink(missing_ok=True)

    def _read(self) -> None:
        try:
            data = self.path.read_bytes()
            whole = data[: data.rfind(b"\n") + 1]  # a line without its end was cut off by a kill
            if len(whole) < len(data):
                os.truncate(self.path, len(whole))
            records = [json.loads(line) for line in whole.splitlines()]
            if not records:
                return self.remove()
            differing = differences(records[0]["settings"], self.settings)
            outcomes = [_outcome(record) for record in records[1:]]
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise OptionError(f"{self.path} is no record of an evaluation ({error}): delete it") from error
        if differing:
            raise OptionError(
                f"{self.path} was begun with other settings ({differing}); delete it or choose another --out"
            )
        self.outcomes = {outcome.seed: outcome for outcome in outcomes}
        return None

    def _results(self) -> dict[int, Outcome]:
        """Return the outcomes that the results hold, by seed."""
        found = read_json(self.out)
        compared = {*self.settings, *_SAID_WHERE_UNUSUAL}
        differing = differences({name: found.get(name) for name in compared}, self.settings)
        if differing:
            raise DataFolderError(f"{self.out} holds results of other settings ({differing}); choose another --out")
        kind = "graph_episode" if found.get("graph") else "episode"
        try:
            outcomes = [_outcome({kind: record}) for record in found["episodes"]]
            outcomes += [_outcome({"discarded": record}) for record in found["discarded_episodes"]]
        except (KeyError, TypeError) as error:
            raise DataFolderError(f"{self.out} holds no episodes ({error!r}); choose another --out") from error
        return {outcome.seed: outcome for outcome in outcomes}


def _kind(outcome: Outcome) -> str:
    if isinstance(outcome, Discarded):
        return "discarded"
    return "episode" if isinstance(outcome, Episode) else "graph_episode"


def _outcome(record: dict[str, Any]) -> Outcome:
    if "episode" in record:
        return Episode.from_dict(record["episode"])
    if "graph_episode" in record:
        return GraphEpisode.from_dict(record["graph_episode"])
    return Discarded(**record["discarded"])
