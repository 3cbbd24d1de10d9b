"""Recorded episodes as a training set: an observation and what was done in it a step, and the finished scene."""

from __future__ import annotations

import json
import math
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from cliport_core.errors import PixelOutsideError
from cliport_core.workspace import WorkspaceSpec
from cliport_episodes.capture_setup import CaptureSetup
from cliport_episodes.demonstration import StepRecord
from cliport_episodes.reader import Episode, Step, read_episode
from cliport_policy.data.dataset_format import FORMAT_VERSION, HEIGHT_UNIT, META_NAME, Demo, Row, part_path, write_part
from cliport_policy.data.new_folder import whole_folder
from cliport_policy.errors import DataError

TASK = "demonstrations"
JAWS_PERIOD = math.pi  # a gripper turned by half a turn holds a thing the same way [rad]
EPISODES_PER_PART = 50


@dataclass(frozen=True)
class Selection:
    """A choice of episodes: those marked as successes always, others as said here."""

    unmarked: bool = True
    failed: bool = False

    def refusal(self, success: bool | None) -> str:
        """Return why an episode is left out; "" where it is not."""
        if success is None and not self.unmarked:
            return "not marked as a success"
        return "marked as a failure" if success is False and not self.failed else ""


@dataclass
class Tally:
    """Counts of what was used, and of what was left out for which reason."""

    episodes: int = 0
    steps: int = 0
    finished: int = 0
    episodes_left_out: Counter[str] = field(default_factory=Counter)
    steps_left_out: Counter[str] = field(default_factory=Counter)
    complaints: list[str] = field(default_factory=list)

    def to_dict(self) -> dict[str, Any]:
        """Return the counts as meta.json has them."""
        return {
            "episodes": self.episodes,
            "steps": self.steps,
            "finished_scenes": self.finished,
            "episodes_left_out": dict(sorted(self.episodes_left_out.items())),
            "steps_left_out": dict(sorted(self.steps_left_out.items())),
        }


def make_data_set(
    paths: Sequence[Path],
    out: Path,
    selection: Selection = Selection(),
    workspace: WorkspaceSpec | None = None,
    on_episode: Callable[[int, Tally], None] = lambda done, tally: None,
) -> Tally:
    """Write the training set of episode folders to `out`, whole or not at all; on_episode hears how many are done.

    workspace: of the heightmaps; by default the one that the episodes were recorded for. The same episodes give the
    same bytes. Raises DataError where nothing is left to learn from, set-ups differ or `out` can't be written, and
    EpisodesError where an episode can't be read.
    """
    tally, first = Tally(), _First()
    with whole_folder(out) as temporary:
        rows: list[Row] = []
        parts = 0
        names: list[str] = []
        for done, path in enumerate(paths, start=1):
            episode = read_episode(path)
            made = []
            if _is_selected(episode, selection, tally):
                made = _rows_of(episode, len(names), first.check(episode, workspace), tally)
            if made:
                names.append(episode.name)
                rows += made
            if rows and (len(names) % EPISODES_PER_PART == 0 or done == len(paths)):
                write_part(part_path(temporary, parts), rows)
                parts, rows = parts + 1, []
            on_episode(done, tally)
        if not tally.steps:
            raise DataError(f"no step of {len(paths)} episodes can be learned from ({_reasons(tally)})")
        assert first.setup is not None
        _write_meta(temporary, first, names, tally)
    return tally


class _First:
    """The set-up that every episode must share with the first."""

    def __init__(self) -> None:
        self.setup: CaptureSetup | None = None
        self.path = Path()
        self.workspace = WorkspaceSpec()

    def check(self, episode: Episode, workspace: WorkspaceSpec | None) -> WorkspaceSpec:
        """Return the workspace of the data set. Raises DataError, in words, where an episode's set-up is another."""
        if self.setup is None:
            self.setup, self.path = episode.setup, episode.path
            self.workspace = workspace or episode.setup.workspace
        differences = self.setup.differences(episode.setup)
        if differences:
            raise DataError(
                f"episodes {self.path.name} (here) and {episode.name} (there) were recorded with different set-ups: "
                f"{'; '.join(differences)}. Make a data set of each"
            )
        return self.workspace


def _is_selected(episode: Episode, selection: Selection, tally: Tally) -> bool:
    """Return True if an episode is to be learned from; count it where it is left out."""
    tally.complaints += [f"{episode.name}: {complaint}" for complaint in episode.complaints]
    refusal = selection.refusal(episode.success)
    if refusal:
        tally.episodes_left_out[refusal] += 1
    return not refusal


def _rows_of(episode: Episode, number: int, workspace: WorkspaceSpec, tally: Tally) -> list[Row]:
    rows: list[Row] = []
    for step in episode.steps:
        demo = _demo_or_count(step, workspace, tally)
        if demo is not None:
            rows.append(_row(number, len(rows), step.observation(), (demo,), workspace))
    if not rows:
        tally.episodes_left_out["no step to learn from"] += 1
        return []
    tally.steps += len(rows)
    if episode.final is not None and episode.success:
        last = episode.steps[-1].record
        done = Demo(last.instruction, done=True, primitive=last.action.primitive.label)
        rows.append(_row(number, len(rows), episode.final, (done,), workspace))
        tally.finished += 1
    tally.episodes += 1
    return rows


def _row(number: int, step: int, observation: Any, demos: tuple[Demo, ...], workspace: WorkspaceSpec) -> Row:
    return Row(TASK, "train", 0, number, step, observation.heightmap(workspace), demos)


def _demo_or_count(step: Step, workspace: WorkspaceSpec, tally: Tally) -> Demo | None:
    """Return what a step teaches; None, and counted, where it failed or lies outside the workspace."""
    record = step.record
    if record.result is not None and not record.result.outcome.is_success:
        tally.steps_left_out[record.result.outcome.label] += 1
        return None
    try:
        return demo_of(record, workspace)
    except PixelOutsideError:
        tally.steps_left_out["outside the workspace"] += 1
        return None


def demo_of(record: StepRecord, workspace: WorkspaceSpec) -> Demo:
    """Return a step as a label on the heightmap. Raises PixelOutsideError."""
    action = record.action
    return Demo.of_action(record.instruction, action.primitive, action.pick, JAWS_PERIOD, action.place, workspace)


def _reasons(tally: Tally) -> str:
    counts = tally.episodes_left_out + tally.steps_left_out
    return ", ".join(f"{count} {reason}" for reason, count in sorted(counts.items())) or "there is none"


def _write_meta(folder: Path, first: _First, names: list[str], tally: Tally) -> None:
    assert first.setup is not None
    meta = {
        "version": FORMAT_VERSION,
        "task": TASK,
        "split": "train",
        "height_unit": HEIGHT_UNIT,
        "workspace": first.workspace.to_dict(),
        "setup": first.setup.to_dict(),
        "episodes": names,
        "counts": tally.to_dict(),
    }
    (folder / META_NAME).write_text(json.dumps(meta, indent=2) + "\n")
