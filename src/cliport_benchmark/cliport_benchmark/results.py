"""`ros2 run cliport_benchmark results`: evaluations of a folder as tables, beside what the paper reports."""

from __future__ import annotations

import csv
import io
import sys
import textwrap
from collections.abc import Sequence
from pathlib import Path

from cliport_benchmark.comma_lists import whole_numbers
from cliport_benchmark.errors import BenchmarkError, DataFolderError, OptionError
from cliport_benchmark.evaluation import LANGUAGE_BLIND, SECTIONS, Evaluation, Section, language_blind, read_folders
from cliport_benchmark.markdown_lines import count, number, table_line
from cliport_benchmark.paper_scores import DEMO_COUNTS, paper_columns, paper_scores
from cliport_benchmark.provenance import command_line
from cliport_benchmark.results_by_split import by_split
from cliport_core.command_line import CommandParser
from cliport_policy.errors import PolicyError
from sim_bridge.errors import TaskPackageError
from sim_bridge.tasks import DEMO_TASKS, LANGUAGE_SPLITS

_REMARK = (
    "Mean scores, 0 to 100; the paper's are of 100 episodes after training on {demos} demonstrations a task, of the "
    "checkpoint that is best on that task's validation scenes, with a suction cup or spatula where a parallel gripper "
    "acts here. Grasps are centred on the thing seen where a column does not say `exact offset`, which the paper's "
    "are. Discarded: scenes that could not be set up at all, the only ones left out of the mean; redrawn: scenes that "
    "were drawn again, since a thing found no place or flew apart before the first action; broken: episodes in which "
    "things flew apart later, which keep the score that stood before. [open] and [strict] after a method: it was told "
    "beforehand what colours' names mean, all of a survey's or those without orange, purple, pink and white; [open] "
    "also what named shapes look like, where its card says `reads_shapes`. Rules find which of equal holes a sentence "
    "means, how a piece lies on its print and from where a sweep meets something, where it says `reads_sides`, "
    "`fits_prints` and `sweeps_things`; where it says `reads_kinds` a network that learned from lists of what lies on "
    "the table leads picks to everyday objects. "
    f"Chance: what random choices would score, where that is known; {LANGUAGE_BLIND}: an agent that sees and handles "
    "everything as the expert but does not hear the sentence (`evaluate --checkpoint blind`); a number in brackets is "
    "of scenes."
)
_ORDER = {task: i for i, task in enumerate((*LANGUAGE_SPLITS, *DEMO_TASKS))}
_WIDTH = 140  # of the lines of text
_OUR_COLUMNS = (
    *("task", "by", "split", "score", "episodes", "discarded", "redrawn", "broken", "chance"),
    LANGUAGE_BLIND,
)


def markdown(evaluations: Sequence[Evaluation], demos: Sequence[int]) -> str:
    """Return the tables that there is something for, a row an evaluation or a task of
    the paper's without one, beside the paper's scores."""
    text = []
    for section in SECTIONS:
        rows = _rows(section, evaluations)
        if not any(row[1] for row in rows):
            continue
        columns = paper_columns(section.table, demos)
        header = [*_OUR_COLUMNS, *(f"{method} @{n}" for method, n in columns)]
        text += [f"## {section.title}", "", table_line(header), table_line(["---"] * 3 + ["---:"] * (len(header) - 3))]
        for cells in rows:
            paper = [paper_scores().get((section.table, method, cells[0], n)) for method, n in columns]
            text.append(table_line([*cells, *map(number, paper)]))
        text.append("")
    return "\n".join(text)


def _both_rules(evaluations: Sequence[Evaluation]) -> list[str]:
    """Return a table of the blind agent's scores under the first rule of this project and the present one."""
    rows = [
        table_line([e.task, e.split, str(e.episodes), number(e.with_next), number(e.score), e.commit[:7]])
        for e in sorted(evaluations, key=lambda e: _ORDER.get(e.task, len(_ORDER)))
        if e.with_next is not None
    ]
    if not rows:
        return []
    header = [table_line(["task", "split", "episodes", "next goal counted too", "score", "commit"])]
    title = f"## What the {LANGUAGE_BLIND} agent reaches, by two rules"
    return [title, "", *header, table_line(["---"] * 2 + ["---:"] * 3 + ["---"]), *rows, ""]


def _doubts(evaluations: Sequence[Evaluation]) -> list[str]:
    doubts = list(dict.fromkeys(f"- {e.agent}: {doubt}" for e in evaluations for doubt in e.doubts))
    return ["## To be measured again", "", *doubts, ""] if doubts else []


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
            writer.writerow([*cells, section.title, *map(number, paper)])
    return file.getvalue()


def main(arguments: list[str] | None = None) -> int:
    """Run the command; return 0 when there was something to show, 1 on an error."""
    parser = CommandParser(prog="results", description="Evaluations as tables beside the paper's.")
    parser.add_argument("folder", type=Path, nargs="+", help="where evaluate wrote its JSON files")
    parser.add_argument("--out", type=Path, help="Markdown file to write, and a .csv beside it")
    parser.add_argument("--by-split", action="store_true", help="a row for each split, a column for each policy")
    parser.add_argument("--demos", default="1000", help="of the paper's columns, or several with commas between")
    options = parser.parse_args(arguments)
    try:
        demos = _demo_counts(options.demos)
        evaluations = read_folders(options.folder)
        text = (by_split if options.by_split else markdown)(evaluations, demos)
        remark = textwrap.fill(_REMARK.format(demos=" or ".join(map(str, demos))), _WIDTH)
        text = "\n".join([text, *_both_rules(evaluations), *_doubts(evaluations), remark, ""])
        if options.out is None:
            print(text, end="")
        else:
            command = command_line("results", sys.argv[1:] if arguments is None else arguments)
            _write(options.out, f"# Results\n\nWritten by `{command}`.\n\n{text}")
            _write(options.out.with_suffix(".csv"), comma_separated(evaluations))
            print(f"{len(evaluations)} evaluations in {options.out} and {options.out.with_suffix('.csv').name}")
    except (BenchmarkError, TaskPackageError, PolicyError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    return 0


def _demo_counts(text: str) -> tuple[int, ...]:
    counts = whole_numbers("--demos", text)
    if not counts or not set(counts) <= set(DEMO_COUNTS):
        raise OptionError(f"--demos must be of {', '.join(map(str, DEMO_COUNTS))}, which the paper has, got {text}")
    return counts


def _rows(section: Section, evaluations: Sequence[Evaluation]) -> list[list[str]]:
    """Return the cells of _OUR_COLUMNS of a section's evaluations, in the order of its tasks.

    Beside a table of the paper's, a task without an evaluation has a row too.
    """
    here = [e for e in evaluations if e.section is section]
    rows = []
    for task in section.tasks or sorted({e.task for e in here}):
        found = [e for e in here if e.task == task]
        rows += [_own_cells(e, evaluations) for e in found]
        if section.table and not found:
            rows.append([task, *[""] * (len(_OUR_COLUMNS) - 1)])
    return rows


def _own_cells(one: Evaluation, evaluations: Sequence[Evaluation]) -> list[str]:
    """Return the cells of _OUR_COLUMNS of an evaluation."""
    blind = language_blind(one, evaluations)
    words = "" if blind is None else number(blind.score)
    if blind is not None and blind.seeds != one.seeds:
        words += f" ({blind.episodes})"
    counts = [count(value) for value in (one.discarded, one.redrawn, one.broken)]
    return [one.task, one.agent, one.split, number(one.score), str(one.episodes), *counts, number(one.chance), words]


def _write(path: Path, text: str) -> None:
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise DataFolderError(f"cannot write {path}: {error.strerror or error}") from error


if __name__ == "__main__":
    sys.exit(main())
