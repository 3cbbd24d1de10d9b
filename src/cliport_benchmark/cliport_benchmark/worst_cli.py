"""`ros2 run cliport_benchmark worst`: pictures of the worst evaluated episodes, and what was confused."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np
from PIL import Image

from cliport_benchmark.confusions import Confusion, confused_colors, counts, judged
from cliport_benchmark.contact_sheet import Captioned, Picture, contact_sheet
from cliport_benchmark.episode import Episode, Step
from cliport_benchmark.errors import BenchmarkError, DataFolderError, OptionError
from cliport_benchmark.evaluation import read_evaluation, read_folder
from cliport_benchmark.json_files import check_writable, read_json
from cliport_benchmark.observer import Observer
from cliport_core import WorkspaceSpec
from cliport_core.command_line import CommandParser
from cliport_core.outcome import Outcome
from sim_bridge.errors import SimBridgeError
from sim_bridge.scene import reset_scene
from sim_bridge.tasks import make_task
from sim_bridge.world import SimWorld

_COLUMNS = 3
_ZOOM = 2  # picture's pixels for one of the heightmap
_RIGHT, _WRONG = (40, 150, 60), (220, 30, 30)
_MOST_COLORS = 20  # rows of confused colours


class Evaluated(NamedTuple):
    """One episode and the evaluation that it is of; shown: whether its scene can be set up here as it was."""

    agent: str
    task: str
    split: str
    shown: bool
    episode: Episode


def main(arguments: list[str] | None = None) -> int:
    """Run the command; return 0 when everything was written, 1 on an error."""
    options = _parser().parse_args(arguments)
    picture, table = options.out / "worst.jpg", options.out / "confusions.md"
    try:
        if options.count < 1:
            raise OptionError(f"--count must be 1 or more, got {options.count}")
        check_writable(picture)
        found = [one for folder in options.folders for read in read_folder(folder, _read) for one in read]
        table.write_text(_confusions(found), encoding="utf-8")
        picture.unlink(missing_ok=True)  # of an earlier run
        worst = _worst(found, options.count)
        if worst:
            Image.fromarray(contact_sheet([_shown(one) for one in worst], _COLUMNS)).save(picture, quality=85)
    except (BenchmarkError, SimBridgeError, OSError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("error: interrupted", file=sys.stderr)
        return 130
    shown = (
        f"{len(worst)} of {len(found)} episodes in {picture}"
        if worst
        else "no episode that can be shown fell short of 1"
    )
    print(f"{shown}; what was confused in {table}")
    return 0


def _read(path: Path) -> list[Evaluated]:
    evaluation, values = read_evaluation(path), read_json(path)
    here = make_task(evaluation.task, evaluation.split).object_source == evaluation.object_set
    try:
        episodes = [Episode.from_dict(episode) for episode in values["episodes"]]
    except (KeyError, TypeError) as error:
        raise DataFolderError(f"{path} holds no episodes with their actions ({error!r})") from error
    shown = here and not evaluation.set_up
    return [Evaluated(evaluation.agent, evaluation.task, evaluation.split, shown, one) for one in episodes]


def _worst(found: Sequence[Evaluated], count: int) -> list[Evaluated]:
    """Return the episodes that fell short of 1, the worst first, of each task in its turn."""
    ranks: dict[str, int] = {}
    ranked = []
    for one in sorted(found, key=lambda one: one.episode.score):
        if one.shown and one.episode.score < 1.0:
            ranks[one.task] = ranks.get(one.task, -1) + 1
            ranked.append((ranks[one.task], one.episode.score, one.task, one))
    return [one for *_, one in sorted(ranked, key=lambda entry: entry[:3])[:count]]


def _shown(one: Evaluated) -> Captioned:
    """Return the scene from above as it was set up, with an arrow from each pick to its place."""
    world = SimWorld()
    try:
        reset_scene(world, one.task, one.split, one.episode.seed)
        observer = Observer(world.config)
        color = observer.heightmap(observer.frame(world)).color
    finally:
        world.close()
    from_above = np.ascontiguousarray(color.transpose(1, 0, 2))  # the robot's side is the upper one
    picture = cv2.resize(from_above, None, fx=_ZOOM, fy=_ZOOM, interpolation=cv2.INTER_LINEAR)
    for number, step in enumerate(one.episode.actions, start=1):
        _draw(picture, world.config.workspace, step, number)
    split = "" if one.split == "test" else f" {one.split}"
    return Captioned(f"{one.task}{split} {one.episode.seed}: {one.episode.score:.2f}", picture, _words(one.episode))


def _draw(picture: Picture, workspace: WorkspaceSpec, step: Step, number: int) -> None:
    ink = _RIGHT if _is_right(step) else _WRONG
    scale = _ZOOM / workspace.pixel_size
    start, end = (
        (round(scale * (y - workspace.y_min)), round(scale * (x - workspace.x_min)))
        for x, y, _ in (step.pick, step.place)
    )
    cv2.arrowedLine(picture, start, end, ink, 2, cv2.LINE_AA, tipLength=0.1)
    cv2.putText(picture, str(number), start, cv2.FONT_HERSHEY_SIMPLEX, 0.5, ink, 1, cv2.LINE_AA)


def _is_right(step: Step) -> bool:
    return step.pick_right and step.place_right and step.outcome == Outcome.SUCCEEDED.name


def _words(episode: Episode) -> str:
    """Return what went wrong first."""
    for number, step in enumerate(episode.actions, start=1):
        if not _is_right(step):
            chosen = f"{step.picked or 'nothing'} to {step.place_at or 'nothing'}"
            return f"{number}: {step.instruction}. {chosen}, {step.outcome.lower().replace('_', ' ')}"
    return episode.error or f"{episode.instruction}. all right, in {episode.steps} steps"


def _confusions(found: Sequence[Evaluated]) -> str:
    """Return tables, in Markdown: what each agent picked and placed at, task by task, and the colours it confused."""
    lines = [
        "# What was confused",
        "",
        "Share of the actions, in per cent, whose pick was of what was asked for, or else of what; and of those with a",
        "right pick the same of the place.",
    ]
    heads = " | ".join(confusion.value for confusion in Confusion)
    for agent in dict.fromkeys(one.agent for one in found):
        lines += ["", f"## {agent}", "", f"| task | split | part | actions | {heads} |"]
        lines.append(f"|---|---|---|---:|{'---:|' * len(Confusion)}")
        own = [one for one in found if one.agent == agent]
        for task, split in dict.fromkeys((one.task, one.split) for one in own):
            of = list(judged(_steps(one for one in own if (one.task, one.split) == (task, split))))
            for part, is_pick in (("pick", True), ("place", False)):
                if numbers := counts(of, is_pick):
                    shares = " | ".join(f"{100.0 * numbers[kind] / numbers.total():.1f}" for kind in Confusion)
                    lines.append(f"| {task} | {split} | {part} | {numbers.total()} | {shares} |")
        colors = confused_colors(judged(_steps(own))).most_common(_MOST_COLORS)
        if colors:
            lines += ["", "| asked for | chosen | times |", "|---|---|---:|"]
            lines += [f"| {asked} | {chosen} | {times} |" for (asked, chosen), times in colors]
    return "\n".join(lines) + "\n"


def _steps(found: Iterable[Evaluated]) -> list[Step]:
    return [step for one in found for step in one.episode.actions]


def _parser() -> argparse.ArgumentParser:
    parser = CommandParser(prog="worst", description="Show the worst episodes of evaluations, and what was confused.")
    parser.add_argument("folders", nargs="+", type=Path, help="folders that evaluate wrote to")
    parser.add_argument("--count", type=int, default=12, help="episodes to show")
    parser.add_argument("--out", type=Path, default=Path("out/worst"), help="folder for worst.jpg and confusions.md")
    return parser


if __name__ == "__main__":
    sys.exit(main())
