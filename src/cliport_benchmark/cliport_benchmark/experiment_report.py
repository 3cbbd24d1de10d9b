"""Experiments of a folder as one JSON, a table beside the paper's numbers, and a plot."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cliport_benchmark.errors import DataFolderError
from cliport_benchmark.evaluation import shows_own_objects
from cliport_benchmark.experiment import RESULT_NAME
from cliport_benchmark.json_files import read_json, write_json
from cliport_benchmark.markdown_lines import count, number, table_line
from cliport_benchmark.paper_scores import (
    ABLATION_TABLE,
    DEMO_COUNTS,
    DEMO_VAL_TABLE,
    TEST_TABLE,
    VAL_TABLE,
    YARDSTICK,
    PaperRow,
    paper_row,
)

_UNSEEN = "unseen-colors"


@dataclass(frozen=True)
class TestScore:
    """One line of the table; scores 0..100, None where every episode was discarded.

    exact: the score where an error of the pick is carried into the place, None where that was not asked for.
    discarded, redrawn, broken: how many of its scenes (see evaluate), None where that is not known.
    row: the paper's network that it stands beside. comparable: False where the paper has no such score: everyday
    objects of this project's own, or "unseen" colours of a policy that met their words in training.
    """

    task: str
    method: str
    n_demos: int
    step: int
    val: float
    score: float | None
    chance: float | None
    episodes: int
    own_task: str
    row: PaperRow = YARDSTICK
    comparable: bool = True
    exact: float | None = None
    discarded: int | None = None
    redrawn: int | None = None
    broken: int | None = None

    @property
    def paper_test(self) -> float | None:
        """The paper's score on test scenes; None where it has none."""
        return self._paper(TEST_TABLE, ABLATION_TABLE)

    @property
    def paper_val(self) -> float | None:
        """The paper's score on validation scenes; None where it has none, or `val` is of another task."""
        return self._paper(VAL_TABLE, DEMO_VAL_TABLE) if self.task == self.own_task else None

    def _paper(self, *tables: str) -> float | None:
        found = [self.row.score(table, self.task, self.n_demos) for table in tables if self.comparable]
        return next((score for score in found if score is not None), None)


def write_report(out: Path) -> list[Path]:
    """Write experiments.json, experiments.md and experiments.png of all experiments that a folder holds.

    Raises:
        DataFolderError: when there is none, or a file can't be written.
    """
    results = [read_json(path) for path in sorted(out.glob(f"*/*/*/{RESULT_NAME}"))]
    if not results:
        raise DataFolderError(f"{out} holds no finished experiment")
    scores = sorted((s for r in results for s in _scores(r)), key=lambda s: (s.task, s.method, s.n_demos))
    paths = [out / f"experiments.{kind}" for kind in ("json", "md", "png")]
    write_json(paths[0], {"experiments": results})
    try:
        paths[1].write_text(table(scores), encoding="utf-8")
        _plot(scores, paths[2])
    except OSError as error:
        raise DataFolderError(f"cannot write the report in {out}: {error.strerror or error}") from error
    return paths


def table(scores: Sequence[TestScore]) -> str:
    """Return the experiments as a table in Markdown."""
    lines = [
        "| task | network | demonstrations | test score | exact offset | paper, test | chance | episodes | val "
        "| paper, val | step | paper's method | discarded | redrawn | broken |",
        "|---|---|---:|---:|---:|---:|---:|---:|---:|---:|---:|---|---:|---:|---:|",
    ]
    for s in scores:
        compared = (s.paper_test, s.paper_val) != (None, None)
        cells = [s.task, s.method, str(s.n_demos), number(s.score), number(s.exact), number(s.paper_test)]
        cells += [
            number(s.chance),
            str(s.episodes),
            f"{s.val:.1f}",
            number(s.paper_val),
            str(s.step),
            s.row.name if compared else "",
            *(count(value) for value in (s.discarded, s.redrawn, s.broken)),
        ]
        lines.append(table_line(cells))
    lines += [
        "",
        "Mean scores, 0 to 100, of the checkpoint that scored highest on val; `chance` picks and places at random",
        "among what is there. Discarded: scenes that could not be set up, the only ones left out of the mean; redrawn:",
        "drawn again; broken: things flew apart, and the score before that stands. The paper's are of the checkpoint",
        "that is best on the task's validation scenes. Its arm has a suction cup or a spatula, this one a parallel",
        "gripper. Tables 1 and 5 are test scores, 4 and 6 validation scores. None stands beside everyday objects of",
        "this project's own, nor beside unseen colours whose words training brought (recolor: surveyed). Grasps were",
        "centred on the thing seen, so that an error of the pick does not reach the place; under `exact offset`",
        "it does, as in the paper (experiment --exact-offset).",
    ]
    return "\n".join(lines) + "\n"


def _scores(result: dict[str, Any]) -> list[TestScore]:
    try:
        val = result["val"][str(result["chosen_step"])]
        row = paper_row(result.get("config", result["method"]), result.get("own_encoders", True))
        own_task = result.get("task", next(iter(result["test"])))
        return [
            TestScore(
                task,
                result["method"],
                result["n_demos"],
                result["chosen_step"],
                val,
                test["mean_score"],
                test["chance"],
                test["n_episodes"],
                own_task,
                row,
                _is_comparable(result, task, test),
                result.get("test_exact", {}).get(task, {}).get("mean_score"),
                *(test.get(name) for name in ("discarded", "redrawn", "broken")),
            )
            for task, test in result["test"].items()
        ]
    except (KeyError, TypeError, StopIteration) as error:
        raise DataFolderError(f"a {RESULT_NAME} is damaged ({error!r}): delete it and run the command again") from error


def _is_comparable(result: dict[str, Any], task: str, test: dict[str, Any]) -> bool:
    if any(result.get(name) for name in ("workspace", "camera", "randomize_scores")):
        return False
    if shows_own_objects(task, str(test.get("object_set") or "")):
        return False
    surveyed = any(text.replace(" ", "") == "train.recolor=surveyed" for text in result.get("settings", ()))
    return not (_UNSEEN in task and result.get("met_surveyed_colors", surveyed))


def _plot(scores: Sequence[TestScore], path: Path) -> None:
    """Score over demonstrations, a panel a task, beside the paper's CLIPort."""
    from matplotlib.figure import Figure  # no pyplot: no display, no state

    tasks = list(dict.fromkeys(s.task for s in scores))
    figure = Figure(figsize=(5.0 * len(tasks), 5.5), layout="constrained")
    for panel, task in zip(figure.subplots(1, len(tasks), squeeze=False)[0], tasks, strict=True):
        for method in dict.fromkeys(s.method for s in scores if s.task == task):
            line = [s for s in scores if (s.task, s.method) == (task, method) and s.score is not None]
            panel.plot([s.n_demos for s in line], [s.score for s in line], marker="o", label=method)
        paper = [(n, YARDSTICK.score(TEST_TABLE, task, n)) for n in DEMO_COUNTS]
        known = [(n, score) for n, score in paper if score is not None]
        if known and any(s.comparable for s in scores if s.task == task):
            panel.plot(*zip(*known, strict=True), "k--", marker="x", label=f"paper, test: {YARDSTICK.main}")
        chance = [s.chance for s in scores if s.task == task and s.chance is not None]
        if chance:
            panel.axhline(sum(chance) / len(chance), color="gray", linewidth=0.8, label="chance")
        panel.set(xscale="log", ylim=(0, 103), title=task, xlabel="demonstrations", ylabel="mean test score")
        panel.legend(fontsize="small", loc="upper center", bbox_to_anchor=(0.5, -0.15))  # names are long
    figure.savefig(path, dpi=120)
