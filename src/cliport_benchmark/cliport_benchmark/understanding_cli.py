"""`ros2 run cliport_benchmark understanding`: how well a policy understands sentences, without acting on them."""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Sequence
from contextlib import closing
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import cv2

from cliport_benchmark.agents import POLICY_MODULE
from cliport_benchmark.done_bias import fitted_done_bias
from cliport_benchmark.errors import BenchmarkError, OptionError
from cliport_benchmark.json_files import check_writable, write_json
from cliport_benchmark.parallel import run_parallel
from cliport_benchmark.policy_facts import policy_facts
from cliport_benchmark.provenance import command_line, machine
from cliport_benchmark.task_names import task_names
from cliport_benchmark.understanding import Asked, Examined, Examiner, Question, shares
from cliport_benchmark.wording import held_out_patterns
from cliport_core.command_line import CommandParser
from cliport_core.source_state import source_state
from cliport_policy.card import load_card, resolve_checkpoint
from cliport_policy.errors import PolicyError
from cliport_policy.whole_files import write_json as write_card
from sim_bridge.errors import SimBridgeError
from sim_bridge.tasks import Task, make_task

Scene = tuple[str, int, int]  # task, seed, and which of the wordings


def main(arguments: list[str] | None = None) -> int:
    """Run the command; return 0 when the report was written, 1 on an error, 2 on a wrong command line."""
    argv = sys.argv[1:] if arguments is None else arguments
    options = _parser().parse_args(argv)
    start = time.monotonic()
    try:
        tasks = _tasks(options)
        check_writable(options.out)
        facts = policy_facts(options.checkpoint)
        examined = _examine(options, [task.name for task in tasks])
        questions = [question for scene in examined for question in scene.questions]
        report = {
            "checkpoint": options.checkpoint,
            **facts,
            "split": options.split,
            "first_seed": options.first_seed,
            "episodes": options.episodes,
            "survey_colors": options.survey_colors,
            "broken_scenes": sum(not scene.whole for scene in examined),
            **shares(questions),
            "wrong": [vars(question) for question in questions if not question.right],
            **source_state().to_dict(),
            "wall_s": round(time.monotonic() - start, 1),
            "command": command_line("understanding", argv),
            "machine": machine(),
        }
        if options.calibrate:
            report["done_bias"] = _calibrate(options.checkpoint, questions)
        write_json(options.out, report)
    except (BenchmarkError, SimBridgeError, PolicyError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("error: interrupted; nothing was written", file=sys.stderr)
        return 130
    print(table(report))
    print(f"written: {options.out}, with every wrong answer")
    return 0


def _tasks(options: argparse.Namespace) -> list[Task]:
    """Return the tasks that are asked about.

    Raises:
        OptionError: on numbers that make no questions, and tasks that cannot be asked about.
    """
    for name, value, least in (
        ("--first-seed", options.first_seed, 0),
        ("--episodes", options.episodes, 1),
        ("--processes", options.processes, 1),
    ):
        if value < least:
            raise OptionError(f"{name} must be {least} or more, got {value}")
    if options.calibrate and options.split != "val":
        raise OptionError(f"--calibrate fits the checkpoint to the scenes: give --split val, not {options.split}")
    tasks = [make_task(name, options.split) for name in task_names(options.task)]
    for task in tasks:
        held_out_patterns(task)
        if options.survey_colors and task.object_source:
            raise OptionError(f"--survey-colors cannot paint the things of {task.name}: leave it out of --task")
    return tasks


def _calibrate(checkpoint: str, questions: Sequence[Question]) -> dict[str, float]:
    """Write the biases of "done" that suit the answers into the checkpoint's card, say what they do, and return them.

    Raises:
        PolicyError: if the card cannot be written.
    """
    path = resolve_checkpoint(checkpoint)
    card = load_card(path)
    found = fitted_done_bias(questions, card.done_bias)
    if not found:
        print("done: nothing to fit, for no goal was reached or none left; the card is as it was")
        return card.done_bias
    biases = {**card.done_bias, **{name: round(fitted.bias, 2) for name, fitted in found.items()}}
    write_card(path.with_suffix(".json"), replace(card, done_bias=biases).to_dict())
    for name, (bias, before, wrong, asked) in found.items():
        print(
            f"done, {name}: {wrong} of {asked} wrong with a bias of {bias:+.2f}, {before} before; written to the card"
        )
    return biases


def _examine(options: argparse.Namespace, tasks: Sequence[str]) -> list[Examined]:
    """Return what was asked about each scene, in the order of tasks and seeds."""
    scenes = [(task, options.first_seed + i, i) for task in tasks for i in range(options.episodes)]
    set_up = partial(_set_up, options.checkpoint, options.split, options.survey_colors)
    found: dict[Scene, Examined] = {}
    with closing(run_parallel(_ask, scenes, options.processes, set_up, preload=(POLICY_MODULE,))) as results:
        for scene, answers in results:
            if isinstance(answers, str):
                raise BenchmarkError(answers)
            found[scene] = answers
            right, asked = sum(question.right for question in answers.questions), len(answers.questions)
            broken = "" if answers.whole else "; then the scene broke"
            print(
                f"[{len(found)}/{len(scenes)}] {scene[0]} seed {scene[1]}: {right} of {asked} answers right{broken}",
                flush=True,
            )
    return [found[scene] for scene in scenes]


_examiner: Examiner | str | None = None  # of this worker process; a string says why there is none


def _set_up(checkpoint: str, split: str, survey_colors: bool) -> None:
    global _examiner
    import torch

    from cliport_policy.policy import load_policy

    cv2.setNumThreads(1)
    torch.set_num_threads(1)
    try:
        _examiner = Examiner(load_policy(checkpoint), split, survey_colors)
    except (BenchmarkError, SimBridgeError, PolicyError) as error:
        _examiner = str(error)


def _ask(scene: Scene) -> Examined | str:
    """Return the answers, or the reason why there are none: errors cross processes as text."""
    if not isinstance(_examiner, Examiner):
        return _examiner or "the worker was not set up"
    task, seed, index = scene
    try:
        return _examiner.examine(task, seed, index)
    except (BenchmarkError, SimBridgeError, PolicyError) as error:
        return f"{task}, seed {seed}: {error}"


def table(report: dict[str, Any]) -> str:
    """Return a table for a terminal: right answers of those asked, of each kind and task; what actions would do."""
    kinds = [kind.value for kind in Asked]
    rows = [*report["tasks"].items(), ("all", report["all"])]
    width = max(len(task) for task, _ in rows)
    lines = [" " * width + "".join(f"{kind:>20}" for kind in kinds)]
    for task, counts in rows:
        cells = (f"{counts[kind]['right']} of {counts[kind]['asked']}" for kind in kinds)
        lines.append(f"{task:<{width}}" + "".join(f"{cell:>20}" for cell in cells))
    for name in (Asked.WORDING.value, Asked.OPEN.value):
        counts = report["all"][name]
        right = ", ".join(f"{what} right in {counts[f'{what}_right']}" for what in ("thing", "place", "both"))
        lines.append(f"{name}: {right} of {counts['asked']}; answered {_others(counts)}")
    if report["broken_scenes"]:
        lines.append(f"{report['broken_scenes']} scenes broke, so that not all of their questions were asked")
    return "\n".join(lines)


def _others(counts: dict[str, Any]) -> str:
    wrong = {answer: n for answer, n in counts["answers"].items() if answer != "act"}
    return ", ".join(f"'{answer}' {n} times" for answer, n in sorted(wrong.items())) or "with an action always"


def _parser() -> argparse.ArgumentParser:
    parser = CommandParser(prog="understanding", description="Ask a policy about scenes, and judge its answers.")
    parser.add_argument("--checkpoint", default="default", help="path, or name of a shipped one")
    parser.add_argument("--task", default="all", help="names with commas between, or all 18 language splits")
    parser.add_argument("--split", default="test", help="train, val or test")
    parser.add_argument("--first-seed", type=int, default=0, help="seed of the first scene of each task")
    parser.add_argument("--episodes", type=int, default=9, help="scenes of each task")
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument(
        "--survey-colors",
        action="store_true",
        help="paint and name the things in colours of a survey, which no demonstration named",
    )
    parser.add_argument(
        "--calibrate",
        action="store_true",
        help="write into the checkpoint's card from when on it says done (with --split val)",
    )
    parser.add_argument("--out", type=Path, default=Path("out/understanding.json"), help="JSON file of the answers")
    return parser


if __name__ == "__main__":
    sys.exit(main())
