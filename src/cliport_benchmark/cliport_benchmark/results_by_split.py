"""Results with a row for each split and a column for each agent, averages below, as the paper prints its table 1."""

from __future__ import annotations

from collections.abc import Sequence
from statistics import fmean

from cliport_benchmark.evaluation import OWN_OBJECTS, TEST, VAL, Evaluation, Section, is_everyday
from cliport_benchmark.markdown_lines import number, table_line
from cliport_benchmark.paper_scores import paper_methods, paper_scores
from sim_bridge.tasks import LANGUAGE_SPLITS

_SHOWN = (TEST, VAL, OWN_OBJECTS)
_LAST = ("expert", "blind")  # columns after those of the policies


def by_split(evaluations: Sequence[Evaluation], demos: int) -> str:
    """Return a table each of test scenes, validation scenes and everyday objects of one's own, where there are any.

    What belongs to none of them is counted in a line below. A column is of one agent on the same scenes; an average is
    given where it has all of its splits. demos: of the paper's columns.
    """
    text: list[str] = []
    for section in _SHOWN:
        here = [evaluation for evaluation in evaluations if evaluation.section is section]
        if here:
            text += [f"## {section.title}", "", *_table(section, here, demos), ""]
    if others := sum(evaluation.section not in _SHOWN for evaluation in evaluations):
        text += [f"{others} of other tasks, scenes or looks are not shown here: leave --by-split out to see them.", ""]
    return "\n".join(text)


def _table(section: Section, evaluations: Sequence[Evaluation], demos: int) -> list[str]:
    everyday = section is OWN_OBJECTS
    tasks = [task for task in LANGUAGE_SPLITS if is_everyday(task) or not everyday]
    columns: dict[str, dict[str, float | None]] = {}
    for name in sorted({_column(e) for e in evaluations}, key=lambda name: (name.startswith(_LAST), name)):
        columns[name] = {e.task: e.score for e in evaluations if _column(e) == name}
    for method in paper_methods(section.table) if section.table else []:
        scores = {task: paper_scores().get((section.table, method, task, demos)) for task in tasks}
        columns[f"{method} @{demos}"] = scores
    lines = [table_line(["split", *columns]), table_line(["---"] + ["---:"] * len(columns))]
    for task in tasks:
        lines.append(table_line([task, *(number(column.get(task)) for column in columns.values())]))
    for kind in ("seen", "unseen"):
        # The rope has one variant, of what was seen.
        own = [t for t in tasks if is_everyday(t) == everyday and ("unseen" in t) == (kind == "unseen")]
        words = f"average, {len(own)} {kind} splits" + ("" if everyday else " without everyday objects")
        lines.append(table_line([words, *(number(_mean([column.get(t) for t in own])) for column in columns.values())]))
    return lines


def _column(evaluation: Evaluation) -> str:
    return f"{evaluation.agent}, seeds {evaluation.seeds}" + f", {evaluation.commit[:7]}" * bool(evaluation.commit)


def _mean(values: Sequence[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return fmean(known) if len(known) == len(values) else None
