"""`ros2 run cliport_policy learn --from-bags DIR --out DIR`: from recorded episodes to a better policy, in one command.

Every fifth episode or so is held out. The others become a training set, the policy is trained on it, and both, the one
that it began with and the new one, are asked about the steps that were held out. Stopped, it asks what it has by then.
Run again, it goes on; with more episodes, or ones edited since, it begins anew beside what was learned before.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import math
import signal
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cliport_core.command_line import CommandParser
from cliport_core.errors import CoreError
from cliport_episodes.bag_metadata import FILE as METADATA
from cliport_episodes.episode_folder import step_paths
from cliport_episodes.errors import EpisodesError
from cliport_policy import train
from cliport_policy.card import load_card
from cliport_policy.comparison import NEAR_MM, summarize
from cliport_policy.config import RECIPES
from cliport_policy.data.demonstrations import load_demonstrations
from cliport_policy.data.episode_folders import find_episodes
from cliport_policy.data.from_bags import Selection, make_data_set
from cliport_policy.errors import DataError, PolicyError
from cliport_policy.offline import OfflineRun
from cliport_policy.policy import load_policy
from cliport_policy.training.initial import load_initial
from cliport_policy.training.pace import MOST_STEPS, length_words, measured_pace, steps_within
from cliport_policy.whole_files import write_json

REPORT_NAME = "learned.json"
FROM_NOTHING, AUTO = "none", "auto"  # in place of a checkpoint to begin with
_HELD_OUT = 5  # of so many episodes one is held out
_LEAST = 4  # episodes; of fewer none is held out
_MINUTES = 30.0  # that a training from nothing takes, unless it is told
STOPPED = 130  # exit status, as after Ctrl-C
_SHOWN = (
    (f"both_within_{NEAR_MM:.0f}_mm", f"pick and place within {NEAR_MM:.0f} mm", lambda value: f"{100 * value:.0f} %"),
    ("pick_mm", "pick, median", lambda value: f"{value['median']:.0f} mm"),
    ("place_mm", "place, median", lambda value: f"{value['median']:.0f} mm"),
)


@dataclass(frozen=True)
class Lesson:
    """Episodes to learn from, those held out, and the folder of what is made of them."""

    learned: tuple[Path, ...]
    held_out: tuple[Path, ...]
    folder: Path

    @classmethod
    def of(cls, episodes: Sequence[Path], out: Path, how: Sequence[str] = ()) -> Lesson:
        """Return what is to be learned of episodes, of which some are held out by their names.

        What was held out stays so when more are recorded, but for the only one of a few. The folder is another one for
        other episodes, for the same with other steps or edits, and for other words of `how`.
        """
        held_out = [path for path in episodes if _number(path.name) % _HELD_OUT == 0]
        if len(episodes) < _LEAST:
            held_out = []
        elif not held_out or len(held_out) == len(episodes):
            held_out = [min(episodes, key=lambda path: _number(path.name))]
        learned = tuple(path for path in episodes if path not in held_out)
        digest = hashlib.sha256("\n".join(how).encode())
        for path in sorted(episodes, key=lambda path: path.name):
            metadata = path / METADATA
            digest.update(f"{path.name} {len(step_paths(path))} ".encode())
            digest.update(metadata.read_bytes() if metadata.is_file() else b"")
        return cls(learned, tuple(held_out), out / digest.hexdigest()[:8])


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command; return the exit status."""
    args = _parser().parse_args(argv)
    started = time.monotonic()
    try:
        how = (args.init, str(args.old), str(args.with_failed), *([] if args.minutes is None else [str(args.minutes)]))
        lesson = Lesson.of(find_episodes(args.from_bags), args.out, how)
        print(
            f"{len(lesson.learned)} episodes to learn from, {len(lesson.held_out)} held out; {lesson.folder}",
            flush=True,
        )
        _make_data(lesson, args)
        init = _beginning(args.init, lesson.folder / "data")
        before = None if init is None else _compared(init, lesson.held_out)
        if status := train.main(_training(lesson, args, init)):
            return status
        signal.signal(signal.SIGINT, signal.default_int_handler)  # which training took for itself
        done, steps = _steps(lesson.folder / "training")
        if not done:
            raise KeyboardInterrupt
        print("the policy is asked about what was held out", flush=True)
        after = _compared(str(lesson.folder / "training"), lesson.held_out)
        minutes = round((time.monotonic() - started) / 60, 1)
        report = {**_report(lesson, init, before, after, minutes), "steps_done": done, "steps": steps}
        for path in (lesson.folder / REPORT_NAME, *([args.report] if args.report else [])):
            write_json(path, report)
    except (PolicyError, CoreError, EpisodesError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("error: interrupted; the same command goes on", file=sys.stderr)
        return STOPPED
    print(_table(before, after, len(lesson.held_out)))
    print(
        f"after {minutes:g} min: ros2 run cliport_policy server --ros-args -p checkpoint:={lesson.folder / 'training'}"
    )
    if done < steps:
        print(f"error: stopped after {done} of {steps} steps; the same command goes on", file=sys.stderr)
        return STOPPED
    return 0


def _make_data(lesson: Lesson, args: argparse.Namespace) -> None:
    """Make the training set, unless it is there."""
    data = lesson.folder / "data"
    if (data / "meta.json").is_file():
        return
    tally = make_data_set(lesson.learned, data, Selection(failed=args.with_failed))
    print(f"{tally.steps} steps and {tally.finished} finished scenes of {tally.episodes} episodes", flush=True)


def _beginning(init: str, data: Path) -> str | None:
    """Return the checkpoint to begin with, None for none; AUTO: `default` where it has the data's workspace."""
    if init != AUTO:
        return None if init == FROM_NOTHING else init
    try:
        load_initial("default").check_workspace(load_demonstrations(data).workspace)
    except DataError as reason:
        print(f"it begins from nothing: {reason}", flush=True)
        return None
    print("it begins with default", flush=True)
    return "default"


def _training(lesson: Lesson, args: argparse.Namespace, init: str | None) -> list[str]:
    """Return the arguments of `train`; init: the checkpoint to begin with, None for none."""
    data = str(lesson.folder / "data")
    words = ["--data", data] if args.old is None else ["--data", f"{data}:0.6", "--data", f"{args.old}:0.4"]
    words += ["--out", str(lesson.folder / "training")]
    if init is not None:
        words += ["--init", init]
    return words + _length(lesson, args, words, init) + args.train_options.split()


def _length(lesson: Lesson, args: argparse.Namespace, words: list[str], init: str | None) -> list[str]:
    """Return the arguments for a training's length: the recipe's, or what fits into the minutes by this machine's pace.

    The length is kept in the lesson's folder, so that the same command goes on with it.
    """
    options = args.train_options.split()
    if "--steps" in options or (init is not None and args.minutes is None):
        return []
    recipe, file = RECIPES["ours" if init is None else "fine_tune"], lesson.folder / "length.json"
    if not file.is_file():
        print("the pace of this machine is measured", flush=True)
        pace = measured_pace([*words, *options], lesson.folder / "pace")
        minutes = _MINUTES if args.minutes is None else args.minutes
        write_json(file, {"steps": steps_within(minutes, pace, MOST_STEPS), "pace": pace})
    steps = int(json.loads(file.read_text(encoding="utf-8"))["steps"])
    print(f"it takes {steps} steps", flush=True)
    return length_words(steps, recipe)


def _steps(training: Path) -> tuple[int, int]:
    """Return how many steps of a training are done, and of how many."""
    made_by = load_card(training / "policy.safetensors").made_by
    return int(made_by["steps_done"]), int(made_by["train"]["steps"])


def _compared(checkpoint: str, episodes: Sequence[Path]) -> dict[str, Any] | None:
    """Return how far a policy is from what was recorded, None where nothing was held out."""
    if not episodes:
        return None
    run = OfflineRun(load_policy(checkpoint))
    for path in episodes:
        run.add(path)
    return summarize(run.comparisons)


def _report(
    lesson: Lesson, init: str | None, before: dict[str, Any] | None, after: dict[str, Any] | None, minutes: float
) -> dict[str, Any]:
    return {
        "init": init or FROM_NOTHING,
        "learned": [episode.name for episode in lesson.learned],
        "held_out": [episode.name for episode in lesson.held_out],
        "before": before,
        "after": after,
        "minutes_of_this_run": minutes,
        "policy": str((lesson.folder / "training").resolve()),
        "table": _rows(before, after),
    }


def _table(before: dict[str, Any] | None, after: dict[str, Any] | None, episodes: int) -> str:
    if after is None:
        return f"no episode was held out: record {_LEAST} or more to see what was learned"
    lines = [f"{after['steps']} steps of {episodes} episodes held out{'before':>16}{'after':>10}"]
    lines += [f"{words:<36}{old:>10}{new:>10}" for words, old, new in _rows(before, after)]
    return "\n".join(lines)


def _rows(before: dict[str, Any] | None, after: dict[str, Any] | None) -> list[tuple[str, str, str]]:
    """Return what is compared, how it was before and how it is after, in words; empty where it is not known."""

    def words_of(found: dict[str, Any] | None, name: str, shown: Callable[[Any], str]) -> str:
        return "" if found is None or name not in found else shown(found[name])

    return [(words, words_of(before, name, shown), words_of(after, name, shown)) for name, words, shown in _SHOWN]


def _minutes(text: str) -> float:
    value = float(text)
    if not 0 < value < math.inf:
        raise argparse.ArgumentTypeError(f"{text} is no number of minutes")
    return value


def _number(name: str) -> int:
    return int.from_bytes(hashlib.sha256(name.encode()).digest()[:4])


def _parser() -> argparse.ArgumentParser:
    parser = CommandParser(prog="learn", description="Train a policy on recorded episodes, and say what it learned.")
    add = parser.add_argument
    add("--from-bags", type=Path, nargs="+", required=True, metavar="DIR", help="data sets of episodes, or episodes")
    add("--out", type=Path, required=True, metavar="DIR", help="folder for what is learned")
    add(
        "--init",
        default=AUTO,
        metavar="CHECKPOINT",
        help="to begin with; none: from nothing; auto: default, or nothing in another workspace than its own",
    )
    add("--old", type=Path, metavar="DIR", help="training set of what it knows already, so that it is not forgotten")
    add("--with-failed", action="store_true", help="use what is marked as a failure, too")
    add(
        "--minutes",
        type=_minutes,
        metavar="N",
        help="for training, by this machine's pace",
    )
    add("--report", type=Path, metavar="FILE", help=f"write what {REPORT_NAME} says there, too")
    add("--train-options", default="", metavar="WORDS", help='more for train, as in "--steps 400"')
    return parser


if __name__ == "__main__":
    sys.exit(main())
