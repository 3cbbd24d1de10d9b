"""`ros2 run cliport_benchmark results`: evaluations of a folder as tables, beside what the paper reports."""

from __future__ import annotations

import csv
import io
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cliport_benchmark.doubts import doubts_about
from cliport_benchmark.errors import BenchmarkError, DataFolderError
from cliport_benchmark.json_files import read_json
from cliport_benchmark.own_setup import condition_words, set_up_words
from cliport_benchmark.paper_scores import (
    ABLATION_TABLE,
    DEMO_COUNTS,
    DEMO_VAL_TABLE,
    TEST_TABLE,
    VAL_TABLE,
    paper_methods,
    paper_scores,
)
from cliport_core.command_line import CommandParser
from cliport_policy.errors import PolicyError
from sim_bridge.errors import TaskPackageError
from sim_bridge.tasks import ALIASES, DEMO_TASKS, LANGUAGE_SPLITS, is_known

_OUR_COLUMNS = ("task", "by", "split", "score", "episodes")
_GOOGLE_OBJECTS = "google "  # prefix of the names of sets of Google Scanned Objects
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


@dataclass(frozen=True)
class Evaluation:
    """One file of results; score 0..100, None when every episode was discarded.

    object_set: of a task with everyday objects. knew_colors: True for a policy that met "unseen" colours in training.
    doubts: reasons to measure it again. own_set_up: True where the workspace, the camera or the looks were others.
    """

    task: str
    agent: str
    split: str
    score: float | None
    episodes: int
    object_set: str = ""
    knew_colors: bool = False
    doubts: tuple[str, ...] = ()
    own_set_up: bool = False

    @property
    def section(self) -> Section:
        """The table that it belongs to: the paper's test scores stand beside test scores only, and so on."""
        if self.own_set_up or self.split not in ("test", "val"):
            return OTHER
        if self.task not in (*LANGUAGE_SPLITS, *DEMO_TASKS):
            return OTHER
        if self.task in DEMO_TASKS:
            return DEMO_TEST if self.split == "test" else DEMO_VAL
        if _EVERYDAY in self.task and not self.object_set.startswith(_GOOGLE_OBJECTS):
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
            bool(set_up_words(values)),
        )
        valid = is_known(task) and (score is None or 0.0 <= score <= 100.0)
    except (KeyError, TypeError, ValueError) as error:
        raise DataFolderError(f"{path} is no result of evaluate ({error!r})") from error
    if not valid:
        raise DataFolderError(f"{path} has an unknown task or an impossible score: {task!s:.60}, {score}")
    return found


def markdown(evaluations: Sequence[Evaluation], demos: int) -> str:
    """Return the tables that there is something for, a row an evaluation or a task of
    the paper's without one, beside the paper's scores."""
    text = []
    for section in SECTIONS:
        rows = _rows(section, evaluations)
        if not any(row[1] for row in rows):
            continue
        methods = paper_methods(section.table) if section.table else []
        header = [*_OUR_COLUMNS, *(f"{method} @{demos}" for method in methods)]
        text += [f"## {section.title}", "", _line(header), _line(["---"] * 3 + ["---:"] * (len(header) - 3))]
        for cells in rows:
            paper = [paper_scores().get((section.table, method, cells[0], demos)) for method in methods]
            text.append(_line([*cells, *map(_number, paper)]))
        text.append("")
    if doubts := list(dict.fromkeys(f"- {e.agent}: {doubt}" for e in evaluations for doubt in e.doubts)):
        text += ["## To be measured again", "", *doubts, ""]
    text.append(
        f"Mean scores, 0 to 100; the paper's are of 100 episodes after training on {demos} demonstrations a task, of "
        "the checkpoint that is best on that task's validation scenes, with a suction cup or spatula where a parallel "
        "gripper acts here."
    )
    return "\n".join(text) + "\n"


def comma_separated(evaluations: Sequence[Evaluation]) -> str:
    """Return the same rows with every column of the paper's tables, filled where a row may stand beside the table."""
    columns = list(dict.fromkeys((table, method, demos) for table, method, _, demos in paper_scores()))
    file = io.StringIO()
    writer = csv.writer(file, lineterminator="\n")
    paper_names = [f"table {table}: {method} @{demos}" for table, method, demos in columns]
    writer.writerow([*_OUR_COLUMNS, "section", *paper_names])
    for section in SECTIONS:
        rows = _rows(section, evaluations)
        if not any(row[1] for row in rows):
            continue
        for cells in rows:
            paper = [
                paper_scores().get((table, method, cells[0], demos)) if table in section.comparable else None
                for table, method, demos in columns
            ]
            writer.writerow([*cells, section.title, *map(_number, paper)])
    return file.getvalue()


def main(arguments: list[str] | None = None) -> int:
    """Run the command; return 0 when there was something to show, 1 on an error."""
    parser = CommandParser(prog="results", description="Evaluations as tables beside the paper's.")
    parser.add_argument("folder", type=Path, help="where evaluate wrote its JSON files")
    parser.add_argument("--out", type=Path, help="Markdown file to write, and a .csv beside it")
    parser.add_argument("--demos", type=int, choices=DEMO_COUNTS, default=1000, help="of the paper's columns")
    options = parser.parse_args(arguments)
    try:
        evaluations = _read_folder(options.folder)
        text = markdown(evaluations, options.demos)
        if options.out is None:
            print(text, end="")
        else:
            _write(options.out, text)
            _write(options.out.with_suffix(".csv"), comma_separated(evaluations))
            print(f"{len(evaluations)} evaluations in {options.out} and {options.out.with_suffix('.csv').name}")
    except (BenchmarkError, TaskPackageError, PolicyError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    return 0


def _agent(values: dict[str, Any]) -> str:
    """Return who acted and how: the checkpoint, its network's name, and what was unusual."""
    words = [str(values["checkpoint"])]
    if values.get("method"):
        words.append(f"({values['method']})")
    text = " ".join(words) + (f", {values['object_set']}" if values.get("object_set") else "")
    return text + condition_words(values)


def _read_folder(folder: Path) -> list[Evaluation]:
    """Read all that a folder and those in it hold; what is no evaluation is left out with a line that says so."""
    if not folder.is_dir():
        raise DataFolderError(f"there is no folder {folder}: name the one that evaluate wrote to")
    evaluations = []
    for path in sorted(folder.rglob("*.json")):
        try:
            evaluations.append(read_evaluation(path))
        except DataFolderError as error:
            print(f"left out: {error}", file=sys.stderr)
    if not evaluations:
        raise DataFolderError(f"{folder} holds no results of evaluate")
    return evaluations


def _rows(section: Section, evaluations: Sequence[Evaluation]) -> list[list[str]]:
    """Return task, by, split, score, episodes of a section's evaluations, in the order of its tasks.

    Beside a table of the paper's, a task without an evaluation has a row too.
    """
    here = [e for e in evaluations if e.section is section]
    rows = []
    for task in section.tasks or sorted({e.task for e in here}):
        found = [e for e in here if e.task == task]
        rows += [[task, e.agent, e.split, _number(e.score), str(e.episodes)] for e in found]
        if section.table and not found:
            rows.append([task, "", "", "", ""])
    return rows


def _number(value: float | None) -> str:
    return "" if value is None else f"{value:.1f}"


def _line(cells: Sequence[str]) -> str:
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"


def _write(path: Path, text: str) -> None:
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise DataFolderError(f"cannot write {path}: {error.strerror or error}") from error


if __name__ == "__main__":
    sys.exit(main())
