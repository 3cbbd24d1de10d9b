"""Finished episodes of an evaluation on disk, a JSON line each, so that an interrupted one goes on where it stopped."""

from __future__ import annotations

import json
import os
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from cliport_benchmark.episode import Episode
from cliport_benchmark.errors import DataFolderError, OptionError
from cliport_benchmark.json_files import as_json, differences


@dataclass(frozen=True)
class Discarded:
    """A scene that is worth nothing, and why: no layout was found, or its objects flew apart."""

    seed: int
    reason: str


Outcome = Episode | Discarded


class Journal:
    """The file beside an evaluation's results: the settings, then an outcome a line.

    A line is written as a whole; of a run that was killed, at most the episode in progress is lost. The file
    appears with the first outcome.

    Raises:
        OptionError: when it was begun with other settings, or is no such file.
    """

    def __init__(self, out: Path, settings: dict[str, Any]) -> None:
        self.out, self.settings = out, as_json(settings)
        self.path = out.with_suffix(".episodes.jsonl")
        self.outcomes: dict[int, Outcome] = {}
        if self.path.exists():
            self._read()

    def add(self, outcome: Outcome) -> None:
        """Keep one more outcome, on disk when this returns."""
        self.outcomes[outcome.seed] = outcome
        kind = "episode" if isinstance(outcome, Episode) else "discarded"
        lines = [json.dumps({kind: asdict(outcome)})]
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


def _outcome(record: dict[str, Any]) -> Outcome:
    return Episode.from_dict(record["episode"]) if "episode" in record else Discarded(**record["discarded"])
