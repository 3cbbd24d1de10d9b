"""`ros2 run cliport_benchmark results`: evaluations of a folder as a table, beside what the paper reports."""

from __future__ import annotations

import argparse
import csv
import io
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from cliport_benchmark.errors import BenchmarkError, DataFolderError
from cliport_benchmark.json_files import read_json
from sim_bridge.tasks import ALIASES, DEMO_TASKS, LANGUAGE_SPLITS

DEMO_COUNTS = (1, 10, 100, 1000)
_PAPER = Path(__file__).with_name("paper_results.csv")  # tables 4 to 6 of the paper's appendix
_SECTIONS = (
    ("Language-conditioned splits (paper: table 4)", LANGUAGE_SPLITS, "4"),
    ("Demo-conditioned tasks (paper: table 6)", DEMO_TASKS, "6"),
)


@dataclass(frozen=True)
class Evaluation:
    """One file of results; score 0..100, None when every episode was discarded."""

    task: str
    agent: str
    split: str
    score: float | None
    episodes: int


@lru_cache(maxsize=1)
def paper_scores() -> dict[tuple[str, str, str, int], float]:
    """What the paper reports, by table, method, task and number of demonstrations."""
    with _PAPER.open(newline="", encoding="utf-8") as file:
        return {
            (row["table"], row["method"], row["task"], int(row["n_demos"])): float(row["score"])
            for row in csv.DictReader(file)
        }


def read_evaluation(path: Path) -> Evaluation:
    """What a file says.

    Raises:
        DataFolderError: when it is no result of `evaluate`.
    """
    values = read_json(path)
    try:
        task = ALIASES.get(values["task"], values["task"])
        score = values["mean_score"]
        agent = str(values["checkpoint"]) + (", other wording" if "wording" in values else "")
        agent += ", through the graph" if values.get("graph") else ""
        agent += f", {values['object_set']}" if values.get("object_set") else ""
        found = Evaluation(task, agent, str(values["split"]), score, int(values["n_episodes"]))
        valid = task in (*LANGUAGE_SPLITS, *DEMO_TASKS) and (score is None or 0.0 <= score <= 100.0)
    except (KeyError, TypeError, ValueError) as error:
        raise DataFolderError(f"{path} is no result of evaluate ({error!r})") from error
    if not valid:
        raise DataFolderError(f"{path} has a task or score that the paper's tables cannot have: {task!s:.60}, {score}")
    return found


def markdown(evaluations: Sequence[Evaluation], demos: int) -> str:
    """Two tables: a row an evaluation, or a task without one; the paper's scores for that many demonstrations."""
    text = []
    for title, tasks, table in _SECTIONS:
        methods = _methods(table)
        header = ["task", "by", "split", "score", "episodes", *(f"{method} @{demos}" for method in methods)]
        text += [f"## {title}", "", _line(header), _line(["---"] * 3 + ["---:"] * (len(header) - 3))]
        for cells in _ours(tasks, evaluations):
            paper = [paper_scores().get((table, method, cells[0], demos)) for method in methods]
            text.append(_line([*cells, *map(_number, paper)]))
        text.append("")
    text.append(
        f"Mean scores, 0 to 100; the paper's are of 100 episodes after training on {demos} demonstrations a task, "
        "with a suction cup or spatula where a parallel gripper acts here."
    )
    return "\n".join(text) + "\n"


def comma_separated(evaluations: Sequence[Evaluation]) -> str:
    """The same rows with every column of the paper's tables 4 to 6."""
    columns = list(dict.fromkeys((table, method, demos) for table, method, _, demos in paper_scores()))
    file = io.StringIO()
    writer = csv.writer(file, lineterminator="\n")
    paper_names = [f"table {table}: {method} @{demos}" for table, method, demos in columns]
    writer.writerow(["task", "by", "split", "score", "episodes", *paper_names])
    for cells in _ours((*LANGUAGE_SPLITS, *DEMO_TASKS), evaluations):
        paper = [paper_scores().get((table, method, cells[0], demos)) for table, method, demos in columns]
        writer.writerow([*cells, *map(_number, paper)])
    return file.getvalue()


def main(arguments: list[str] | None = None) -> int:
    """Entry point; 0 when there was something to show, 1 on an error."""
    parser = argparse.ArgumentParser(prog="results", description="Evaluations as a table beside the paper's.")
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
    except BenchmarkError as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    return 0


def _read_folder(folder: Path) -> list[Evaluation]:
    """All that a folder and those in it hold; what is no evaluation is left out with a line that says so."""
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


def _ours(tasks: Sequence[str], evaluations: Sequence[Evaluation]) -> list[list[str]]:
    """task, by, split, score, episodes of every evaluation, in the order of the tasks."""
    rows = []
    for task in tasks:
        found = [e for e in evaluations if e.task == task]
        rows += [[task, e.agent, e.split, _number(e.score), str(e.episodes)] for e in found] or [[task, "", "", "", ""]]
    return rows


def _methods(table: str) -> list[str]:
    return list(dict.fromkeys(method for t, method, _, _ in paper_scores() if t == table))


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
