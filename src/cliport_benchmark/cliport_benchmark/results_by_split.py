"""Results with a row for each split and a column for each agent, averages below, as the paper prints its table 1."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from statistics import fmean

from cliport_benchmark.evaluation import LANGUAGE_BLIND, OWN_OBJECTS, TEST, VAL, Evaluation, Section, is_everyday
from cliport_benchmark.markdown_lines import count, number, table_line
from cliport_benchmark.paper_scores import paper_columns, paper_scores
from sim_bridge.tasks import LANGUAGE_SPLITS

_SHOWN = (TEST, VAL, OWN_OBJECTS)
_LAST = ("expert", "blind")  # columns after those of the policies


def by_split(evaluations: Sequence[Evaluation], demos: Sequence[int]) -> str:
    """Return a table each of test scenes, validation scenes and everyday objects of one's own, where there are any.

    What belongs to none of them is counted in a line below. A column is of one agent on scenes from one seed on; their
    number stands in brackets where it differs from split to split, and so do scenes that were discarded or drawn again
    and episodes that broke, where there are any. An average is given where it has all of its splits.
    demos: numbers of demonstrations of the paper's columns.
    """
    text: list[str] = []
    for section in _SHOWN:
        here = [evaluation for evaluation in evaluations if evaluation.section is section]
        if here:
            text += [f"## {section.title}", "", *_table(section, here, demos), ""]
    if others := sum(evaluation.section not in _SHOWN for evaluation in evaluations):
        text += [f"{others} of other tasks, scenes or looks are not shown here: leave --by-split out to see them.", ""]
    return "\n".join(text)


@dataclass(frozen=True)
class _Column:
    """One column: its title, the scores 0..100 that its averages are of, and what stands in it instead of the bare
    score, by task."""

    title: str
    scores: Mapping[str, float | None]
    cells: Mapping[str, str] = field(default_factory=dict)

    def cell(self, task: str) -> str:
        """Return what stands in a task's row."""
        return self.cells.get(task, number(self.scores.get(task)))


def _table(section: Section, evaluations: Sequence[Evaluation], demos: Sequence[int]) -> list[str]:
    everyday = section is OWN_OBJECTS
    tasks = [task for task in LANGUAGE_SPLITS if is_everyday(task) or not everyday]
    columns = _own_columns(evaluations)
    for method, n in paper_columns(section.table, demos):
        scores = {task: paper_scores().get((section.table, method, task, n)) for task in tasks}
        columns.append(_Column(f"{method} @{n}", scores))
    lines = [table_line(["split", *(column.title for column in columns)])]
    lines.append(table_line(["---"] + ["---:"] * len(columns)))
    lines += [table_line([task, *(column.cell(task) for column in columns)]) for task in tasks]
    for kind in ("seen", "unseen"):
        # The rope has one variant, of what was seen.
        splits = [t for t in tasks if is_everyday(t) == everyday and ("unseen" in t) == (kind == "unseen")]
        words = f"average, {len(splits)} {kind} splits" + ("" if everyday else " without everyday objects")
        means = [_mean([column.scores.get(task) for task in splits]) for column in columns]
        lines.append(table_line([words, *map(number, means)]))
    return lines


def _own_columns(evaluations: Sequence[Evaluation]) -> list[_Column]:
    """Return a column an agent, and one of chance where that is known."""
    columns = []
    for name, own in sorted(_by_column(evaluations).items(), key=lambda item: (item[0].startswith(_LAST), item[0])):
        differ = len({e.episodes for e in own}) > 1
        title = f"{LANGUAGE_BLIND} ({name})" if own[0].is_blind else name
        columns.append(_Column(title, {e.task: e.score for e in own}, {e.task: _cell(e, differ) for e in own}))
    chances = {e.task: e.chance for e in sorted(evaluations, key=lambda e: e.episodes) if e.chance is not None}
    return [*columns, _Column("chance", chances)] if chances else columns


def _cell(one: Evaluation, says_episodes: bool) -> str:
    """Return a score with what is to be said of its scenes in brackets."""
    counts = {"discarded": one.discarded, "redrawn": one.redrawn, "broken": one.broken}
    remarks = [str(one.episodes)] * (says_episodes and one.score is not None)
    if all(value is None for value in counts.values()):
        remarks.append("redraws not counted")
    else:
        remarks += [f"{count(value)} {what}" for what, value in counts.items() if value != 0]
    return number(one.score) + (f" ({', '.join(remarks)})" if remarks else "")


def _by_column(evaluations: Sequence[Evaluation]) -> dict[str, list[Evaluation]]:
    """Return the evaluations of each column by its name."""
    groups: dict[tuple[str, str], list[Evaluation]] = {}
    for one in evaluations:
        groups.setdefault((one.agent, one.seeds.split(" ")[0]), []).append(one)
    columns: dict[str, list[Evaluation]] = {}
    for (agent, first), own in groups.items():
        each_once = len({one.task for one in own}) == len(own)
        if each_once and len({(one.seeds, one.commit) for one in own}) > 1:
            commits = sorted({one.commit[:7] for one in own if one.commit})
            columns[", ".join([agent, f"seeds from {first} on (how many)", *commits])] = own
            continue
        for one in own:
            name = ", ".join([agent, f"seeds {one.seeds}"] + [one.commit[:7]] * bool(one.commit))
            columns.setdefault(name, []).append(one)
    return columns


def _mean(values: Sequence[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return fmean(known) if len(known) == len(values) else None
