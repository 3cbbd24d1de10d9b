"""Evaluations as `evaluate` writes them, and the table of the results that each belongs to."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

from cliport_benchmark.agents import BLIND
from cliport_benchmark.doubts import doubts_about
from cliport_benchmark.errors import DataFolderError
from cliport_benchmark.json_files import read_json
from cliport_benchmark.own_setup import condition_words, set_up_words
from cliport_benchmark.paper_scores import ABLATION_TABLE, DEMO_VAL_TABLE, TEST_TABLE, VAL_TABLE
from sim_bridge.tasks import ALIASES, DEMO_TASKS, LANGUAGE_SPLITS, is_known

Read = TypeVar("Read")
Number = TypeVar("Number", int, float)
_GOOGLE_OBJECTS = "google "  # prefix of the names of sets of Google Scanned Objects
LANGUAGE_BLIND = "language-blind, manually perfect"  # the column of the blind agent
_EVERYDAY = "google-objects"  # part of the names of the tasks that show them


@dataclass(frozen=True)
class Section:
    """One table of the results: a title, its tasks in order, and the paper's table beside it, "" for none."""

    title: str
    tasks: tuple[str, ...]
    table: str = ""

    @property
    def comparable(self) -> tuple[str, ...]:
        """All tables of the paper's on the same scenes: the ablations of table 5 were scored on test scenes."""
        return (TEST_TABLE, ABLATION_TABLE) if self.table == TEST_TABLE else (self.table,)


TEST = Section("Language-conditioned splits, test scenes (paper: table 1)", LANGUAGE_SPLITS, TEST_TABLE)
VAL = Section("Language-conditioned splits, validation scenes (paper: table 4)", LANGUAGE_SPLITS, VAL_TABLE)
DEMO_TEST = Section("Demo-conditioned tasks, test scenes (the paper has no test scores of them)", DEMO_TASKS)
DEMO_VAL = Section("Demo-conditioned tasks, validation scenes (paper: table 6)", DEMO_TASKS, DEMO_VAL_TABLE)
OWN_OBJECTS = Section("Everyday objects of this project's own (the paper has none of them)", LANGUAGE_SPLITS)
TOLD = Section("Unseen colours, of policies that met their words in training (recolor: surveyed)", LANGUAGE_SPLITS)
OTHER = Section("Other tasks, training scenes and set-ups of one's own", ())
SECTIONS = (TEST, VAL, DEMO_TEST, DEMO_VAL, OWN_OBJECTS, TOLD, OTHER)


def is_everyday(task: str) -> bool:
    """Return True for a split that shows everyday objects."""
    return _EVERYDAY in task


def shows_own_objects(task: str, object_set: str) -> bool:
    """Return True where the everyday objects are others than the paper's, which no score of its stands beside."""
    return is_everyday(task) and not object_set.startswith(_GOOGLE_OBJECTS)


@dataclass(frozen=True)
class Evaluation:
    """One file of results; score 0..100, None when every episode was discarded.

    object_set: of a task with everyday objects. knew_colors: True for a policy that met "unseen" colours in training.
    doubts: reasons to measure it again. set_up: how the workspace, the camera or the looks were others, in words.
    seeds: the first and the last of its scenes, as "0 to 99". commit: of the source that scored it. discarded: scenes
    that could not be set up, left out of the mean. redrawn, broken: how many scenes were drawn again, and in how many
    things flew apart; chance: score 0..100 of random choices; with_next: score 0..100 with the next goal counted as far
    as it is fulfilled already. None where the file does not say.
    """

    task: str
    agent: str
    split: str
    score: float | None
    episodes: int
    object_set: str = ""
    knew_colors: bool = False
    doubts: tuple[str, ...] = ()
    set_up: str = ""
    seeds: str = ""
    commit: str = ""
    discarded: int | None = None
    redrawn: int | None = None
    broken: int | None = None
    chance: float | None = None
    is_blind: bool = False
    with_next: float | None = None

    @property
    def section(self) -> Section:
        """The table that it belongs to: the paper's test scores stand beside test scores only, and so on."""
        if self.set_up or self.split not in ("test", "val"):
            return OTHER
        if self.task not in (*LANGUAGE_SPLITS, *DEMO_TASKS):
            return OTHER
        if self.task in DEMO_TASKS:
            return DEMO_TEST if self.split == "test" else DEMO_VAL
        if shows_own_objects(self.task, self.object_set):
            return OWN_OBJECTS
        if self.knew_colors and "unseen-colors" in self.task:
            return TOLD
        return TEST if self.split == "test" else VAL


def read_evaluation(path: Path) -> Evaluation:
    """Read an evaluation from its file.

    Raises:
        DataFolderError: when it is no result of `evaluate`.
    """
    values = read_json(path)
    try:
        task = ALIASES.get(values["task"], values["task"])
        score = values["mean_score"]
        found = Evaluation(
            task,
            _agent(values),
            str(values["split"]),
            score,
            int(values["n_episodes"]),
            str(values.get("object_set") or ""),
            bool(values.get("met_surveyed_colors")),
            doubts_about(values),
            set_up_words(values),
            _seeds(values),
            str(values.get("commit", "")),
            _known(values, "discarded", int),
            _known(values, "redrawn", int),
            _known(values, "broken", int),
            _known(values, "chance", float),
            values["checkpoint"] == BLIND,
            _known(values, "mean_score_with_next", float),
        )
        valid = is_known(task) and (score is None or 0.0 <= score <= 100.0)
    except (KeyError, TypeError, ValueError) as error:
        raise DataFolderError(f"{path} is no result of evaluate ({error!r})") from error
    if not valid:
        raise DataFolderError(f"{path} has an unknown task or an impossible score: {task!s:.60}, {score}")
    return found


def read_folders(folders: Iterable[Path]) -> list[Evaluation]:
    """Read all that folders and those in them hold; what is no evaluation is left out with a line that says so.

    Raises:
        DataFolderError: when one of them does not exist, or holds no evaluation.
    """
    return [evaluation for folder in folders for evaluation in read_folder(folder, read_evaluation)]


def read_folder(folder: Path, read: Callable[[Path], Read]) -> list[Read]:
    """Return what `read` makes of each file in a folder, at any depth; what it raises DataFolderError for is left out.

    Raises:
        DataFolderError: when the folder does not exist, or holds no evaluation.
    """
    if not folder.is_dir():
        raise DataFolderError(f"there is no folder {folder}: name the one that evaluate wrote to")
    found = []
    for path in sorted(folder.rglob("*.json")):
        try:
            found.append(read(path))
        except DataFolderError as error:
            print(f"left out: {error}", file=sys.stderr)
    if not found:
        raise DataFolderError(f"{folder} holds no results of evaluate")
    return found


def language_blind(one: Evaluation, evaluations: Sequence[Evaluation]) -> Evaluation | None:
    """Return the blind agent's evaluation that tells what a score is worth, None where there is none: of the same task,
    split, objects and kind of set-up; of several the one of the same scenes, else of the most."""
    scenes = (one.task, one.split, one.object_set, one.set_up)
    alike = [e for e in evaluations if e.is_blind and (e.task, e.split, e.object_set, e.set_up) == scenes]
    return max(alike, key=lambda e: (e.seeds == one.seeds, e.episodes), default=None)


def _agent(values: dict[str, Any]) -> str:
    """Return who acted and how: the checkpoint, as seen from here, its network's name, and what was unusual."""
    path = Path(str(values["checkpoint"]))
    words = [str(path.relative_to(Path.cwd()) if path.is_relative_to(Path.cwd()) else path)]
    if values.get("method"):
        words.append(f"({values['method']})")
    text = " ".join(words) + (f", {values['object_set']}" if values.get("object_set") else "")
    return text + condition_words(values)


def _known(values: dict[str, Any], name: str, kind: Callable[[Any], Number]) -> Number | None:
    return None if values.get(name) is None else kind(values[name])


def _seeds(values: dict[str, Any]) -> str:
    first = values.get("first_seed")
    if not isinstance(first, int):
        return ""
    return f"{first} to {first + int(values['n_episodes']) + int(values.get('discarded', 0)) - 1}"
