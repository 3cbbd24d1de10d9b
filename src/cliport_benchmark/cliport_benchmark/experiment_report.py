"""Experiments of a folder as one JSON, a table beside the paper's numbers, and a plot."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cliport_benchmark.errors import DataFolderError
from cliport_benchmark.experiment import RESULT_NAME
from cliport_benchmark.json_files import read_json, write_json
from cliport_benchmark.results import DEMO_COUNTS, paper_scores

YARDSTICK = "CLIPORT (single)"
# Which of the paper's rows a named config is; what has none is set beside the yardstick.
PAPER_METHODS = {
    "cliport": YARDSTICK,
    "transporter": "Transporter-only",
    "clip_only": "CLIP-only",
    "rn50_bert": "RN50-BERT",
    "image_goal": "One-Stream Image-Goal Transporter",
    "language_transporter": "One-Stream Language Transporter",
    "wo_skips": "Two-Stream CLIP-Transporter w/o skips",
    "untrained_sem": "Two-Stream Untrained-Sem-Transporter",
    "cliport_wo_lang": "CLIPORT w/o Lang",
    "compact_wo_lang": "Transporter-only",
    "compact_wo_height": "CLIP-only",
}


@dataclass(frozen=True)
class TestScore:
    """One line of the table; scores 0..100."""

    task: str
    method: str
    n_demos: int
    step: int
    val: float
    score: float
    chance: float | None
    episodes: int

    @property
    def paper_method(self) -> str:
        """The paper's row that it stands beside."""
        return PAPER_METHODS.get(self.method, YARDSTICK)

    @property
    def paper(self) -> float | None:
        """The paper's score."""
        return _paper(self.paper_method, self.task, self.n_demos)


def write_report(out: Path) -> list[Path]:
    """experiments.json, experiments.md and experiments.png of all experiments that a folder holds.

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
    """Markdown."""
    lines = [
        "| task | network | demonstrations | test score | chance | episodes | val | step | paper | paper's method |",
        "|---|---|---:|---:|---:|---:|---:|---:|---:|---|",
    ]
    for s in scores:
        cells = [s.task, s.method, str(s.n_demos), f"{s.score:.1f}", _number(s.chance), str(s.episodes)]
        cells += [f"{s.val:.1f}", str(s.step), _number(s.paper), s.paper_method if s.paper is not None else ""]
        lines.append("| " + " | ".join(cells) + " |")
    lines += ["", "Mean scores, 0 to 100, of the checkpoint that scored highest on val; `chance` picks and places at"]
    lines += [
        "random among what is there. The paper's arm has a suction cup or a spatula, this one a parallel gripper."
    ]
    return "\n".join(lines) + "\n"


def _scores(result: dict[str, Any]) -> list[TestScore]:
    try:
        val = result["val"][str(result["chosen_step"])]
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
            )
            for task, test in result["test"].items()
        ]
    except (KeyError, TypeError) as error:
        raise DataFolderError(f"a {RESULT_NAME} is damaged ({error!r}): delete it and run the command again") from error


def _plot(scores: Sequence[TestScore], path: Path) -> None:
    """Score over demonstrations, a panel a task, beside the paper's CLIPort."""
    from matplotlib.figure import Figure  # no pyplot: no display, no state

    tasks = list(dict.fromkeys(s.task for s in scores))
    figure = Figure(figsize=(5.0 * len(tasks), 5.5), layout="constrained")
    for panel, task in zip(figure.subplots(1, len(tasks), squeeze=False)[0], tasks, strict=True):
        for method in dict.fromkeys(s.method for s in scores if s.task == task):
            line = [s for s in scores if (s.task, s.method) == (task, method)]
            panel.plot([s.n_demos for s in line], [s.score for s in line], marker="o", label=method)
        paper = [(n, _paper(YARDSTICK, task, n)) for n in DEMO_COUNTS]
        known = [(n, score) for n, score in paper if score is not None]
        if known:
            panel.plot(*zip(*known, strict=True), "k--", marker="x", label=f"paper: {YARDSTICK}")
        chance = [s.chance for s in scores if s.task == task and s.chance is not None]
        if chance:
            panel.axhline(sum(chance) / len(chance), color="gray", linewidth=0.8, label="chance")
        panel.set(xscale="log", ylim=(0, 103), title=task, xlabel="demonstrations", ylabel="mean test score")
        panel.legend(fontsize="small", loc="upper center", bbox_to_anchor=(0.5, -0.15))  # names are long
    figure.savefig(path, dpi=120)


def _paper(method: str, task: str, n_demos: int) -> float | None:
    found = [paper_scores().get((name, method, task, n_demos)) for name in ("4", "5", "6")]
    return next((score for score in found if score is not None), None)


def _number(value: float | None) -> str:
    return "" if value is None else f"{value:.1f}"
