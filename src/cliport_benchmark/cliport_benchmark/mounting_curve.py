"""`ros2 run cliport_benchmark mounting_curve`: what an error of the camera's calibration costs, as a plot."""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cliport_benchmark.errors import BenchmarkError, DataFolderError
from cliport_benchmark.json_files import check_writable, read_json
from cliport_benchmark.variation import Aspect
from cliport_core.command_line import CommandParser

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_Z = 1.96  # standard errors of a 95 % interval


@dataclass(frozen=True)
class MountingScore:
    """Score (0..100) under calibration errors, with their standard deviations per axis.

    shift: [mm]. turn: [degrees]. half_width: of the score's 95 % interval, from the spread of its episodes.
    """

    agent: str
    shift: float
    turn: float
    score: float
    half_width: float
    episodes: int


def read_mounting_scores(folder: Path) -> list[MountingScore]:
    """Read what `evaluate --randomize mounting --mounting-error MM DEG`, or without both, wrote to a folder.

    Raises:
        DataFolderError: when it holds nothing else, results of other variations, or of several tasks or scenes.
    """
    results = [(path, read_json(path)) for path in sorted(folder.glob("*.json"))]
    if not results:
        raise DataFolderError(f"{folder} holds no results: run evaluate --randomize mounting --out {folder}/NAME.json")
    scores = [_score(path, values) for path, values in results]
    first, settings = results[0][0], _scenes(results[0][1])
    for path, values in results[1:]:
        if _scenes(values) != settings:
            raise DataFolderError(f"{path} and {first} are of other scenes: keep one task, split and seeds in a folder")
    return sorted(scores, key=lambda one: (one.agent, one.shift, one.turn))


def draw_curve(scores: Sequence[MountingScore]) -> Figure:
    """Return a figure of the score over the shift, and over the turn, a line a policy.

    Raises:
        DataFolderError: when neither error was varied alone.
    """
    from matplotlib.figure import Figure  # no pyplot: no display, no state

    shifts = [one for one in scores if one.turn == 0.0]
    turns = [one for one in scores if one.shift == 0.0]
    if not (_varies(shifts) or _varies(turns)):
        raise DataFolderError("no shift without a turn, and no turn without a shift, was scored: nothing to draw")
    figure = Figure(figsize=(9.0, 4.2), layout="constrained")
    panels = figure.subplots(1, 2, sharey=True)
    for panel, line, name in zip(panels, (shifts, turns), ("shift", "turn"), strict=True):
        for agent in dict.fromkeys(one.agent for one in line):
            own = [one for one in line if one.agent == agent]
            at = [getattr(one, name) for one in own]
            panel.errorbar(at, [o.score for o in own], [o.half_width for o in own], marker="o", capsize=3, label=agent)
        panel.set(ylim=(0, 103), xlabel=f"{name} of the camera, σ per axis [{'mm' if name == 'shift' else 'degrees'}]")
        panel.grid(alpha=0.3)
        if line:
            panel.legend(fontsize="small", loc="lower left")
    panels[0].set_ylabel("mean score, with 95 % interval")
    return figure


def main(arguments: list[str] | None = None) -> int:
    """Run the command; return 0 when the picture was written, 1 on an error."""
    parser = CommandParser(prog="mounting_curve", description="Scores over the error of the camera's calibration.")
    parser.add_argument("folder", type=Path, help="where evaluate wrote its JSON files, one for each error")
    parser.add_argument("--out", type=Path, required=True, help="picture to write, .png or .svg")
    options = parser.parse_args(arguments)
    try:
        if options.out.suffix not in (".png", ".svg"):
            raise DataFolderError(f"--out {options.out} must end in .png or .svg")
        scores = read_mounting_scores(options.folder)
        check_writable(options.out)
        draw_curve(scores).savefig(options.out, dpi=110)
    except BenchmarkError as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    for one in scores:
        errors = f"{one.shift:g} mm, {one.turn:g} degrees"
        print(f"{one.agent}, {errors}: {one.score:.1f} ± {one.half_width:.1f} ({one.episodes} episodes)")
    print(options.out)
    return 0


def _score(path: Path, values: dict[str, Any]) -> MountingScore:
    varied = values.get("randomize") or {}
    try:
        errors = dict(varied).pop(Aspect.MOUNTING.value, {"shift": 0.0, "turn": 0.0})
        others = sorted(set(varied) - {Aspect.MOUNTING.value})
        scores = [100.0 * float(episode["score"]) for episode in values["episodes"]]
        mean = sum(scores) / len(scores)
        spread = math.sqrt(sum((score - mean) ** 2 for score in scores) / max(len(scores) - 1, 1))
        found = MountingScore(
            str(values["checkpoint"]),
            round(1000.0 * float(errors["shift"]), 6),
            round(math.degrees(float(errors["turn"])), 6),
            mean,
            _Z * spread / math.sqrt(len(scores)),
            len(scores),
        )
    except (KeyError, TypeError, ValueError, ZeroDivisionError) as error:
        raise DataFolderError(f"{path} is no result of evaluate with episodes ({error!r})") from error
    if others:
        raise DataFolderError(f"{path} varied {', '.join(others)}, too: keep results of --randomize mounting alone")
    return found


def _scenes(values: dict[str, Any]) -> tuple[Any, ...]:
    names = ("task", "split", "first_seed", "n_episodes", "offset", "workspace", "camera", "camera_kind")
    return tuple(values.get(name) for name in names)


def _varies(scores: Sequence[MountingScore]) -> bool:
    return len({(one.shift, one.turn) for one in scores}) > 1
