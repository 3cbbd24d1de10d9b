"""Report of an offline run: a JSON with every step, a table, and pictures of the worst steps."""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from cliport_policy.comparison import Comparison, RecordedStep, summarize
from cliport_policy.errors import DataError
from cliport_policy.explain_picture import render_explanation
from cliport_policy.overlays import save_png
from cliport_policy.policy import Policy

REPORT_NAME = "offline.json"
_COLUMNS = ("pick px", "mm", "deg", "place px", "mm", "turn deg", "done")


def write_report(
    out: Path, checkpoint: str, comparisons: Sequence[Comparison], finished: Sequence[dict[str, Any]]
) -> None:
    """Write offline.json into `out`; the same bags and weights give the same bytes.

    Raises:
        DataError: if it can't be written.
    """
    report = {
        "checkpoint": checkpoint,
        "summary": summarize(comparisons),
        "steps": [comparison.to_dict() for comparison in comparisons],
        "finished_scenes": list(finished),
    }
    try:
        out.mkdir(parents=True, exist_ok=True)
        (out / REPORT_NAME).write_text(json.dumps(report, indent=2) + "\n")
    except OSError as error:
        raise _unwritable(out, error) from error


def table(comparisons: Sequence[Comparison]) -> str:
    """Return a table with a line for each step, and the summary under it."""
    lines = [f"{'episode':<24}{'step':>5}" + "".join(f"{name:>9}" for name in _COLUMNS) + "  instruction"]
    for c in comparisons:
        head = f"{c.source[-23:]:<24}{c.step:>5}"
        if c.errors is None:
            lines.append(f"{head}  refused: {c.refused}")
            continue
        e = c.errors
        values = (e.pick_px, e.pick_mm, e.pick_deg, e.place_px, e.place_mm, e.turn_deg)
        numbers = "".join(f"{value:>9.1f}" for value in values)
        lines.append(f"{head}{numbers}{c.done_probability or 0.0:>9.2f}  {c.instruction}")
    return "\n".join([*lines, "", *_summary_lines(summarize(comparisons))])


def save_worst(out: Path, policy: Policy, ranked: Sequence[tuple[Comparison, RecordedStep]]) -> list[Path]:
    """Draw each step's explanation above what was recorded, and return the paths of the pictures.

    Raises:
        DataError: if a picture can't be written.
    """
    paths = []
    for rank, (comparison, step) in enumerate(ranked, start=1):
        explanation = policy.explain(step.heightmap, step.instruction)
        picture = render_explanation(
            step.heightmap, step.instruction, explanation, (step.action.pick, step.action.place)
        )
        name = re.sub(r"[^A-Za-z0-9._-]", "_", f"worst_{rank:02d}_{comparison.source}_step_{comparison.step:03d}.png")
        try:
            save_png(out / name, picture)
        except OSError as error:
            raise _unwritable(out, error) from error
        paths.append(out / name)
    return paths


def _summary_lines(summary: dict[str, Any]) -> list[str]:
    lines = [f"{summary['steps']} steps, {summary['refused']} refused"]
    for name, value in summary.items():
        words = name.replace("_", " ")
        if isinstance(value, dict):
            lines.append(
                f"{words}: median {value['median']:g}, nine in ten {value['nine_in_ten']:g}, worst {value['worst']:g}"
            )
        elif "within" in name:
            lines.append(f"{words}: {100 * value:.0f} %")
    return lines


def _unwritable(out: Path, error: OSError) -> DataError:
    return DataError(f"cannot write into {out} ({error.strerror or error}): give another --out")
