"""`ros2 run cliport_benchmark record`: the expert's demonstrations as bags, so that there are some without a robot.

An episode is known by its task, split and seed, and by its sentence where --instructions gives one: those that the data
set has are not made again, so that the same command goes on where it was interrupted.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections import Counter
from contextlib import closing
from pathlib import Path

from cliport_benchmark.errors import BenchmarkError, OptionError
from cliport_benchmark.own_setup import add_setup_options, add_variation_options, setup_of, variation_of
from cliport_benchmark.record import ExpertRecorder, RecordConfig, Result
from cliport_core.command_line import CommandParser
from cliport_episodes.errors import EpisodesError
from sim_bridge.errors import SimBridgeError
from sim_bridge.tasks import ALIASES


def main(arguments: list[str] | None = None) -> int:
    """Run the command; return 0 when all episodes were recorded, 1 on an error, 2 on a wrong command line."""
    options = _parser().parse_args(arguments)
    try:
        sentences = _sentences(options.instructions)
        task = ALIASES.get(options.task, options.task)
        config = RecordConfig(
            task,
            options.split,
            options.first_seed,
            options.episodes,
            sentences,
            setup_of(options),
            variation_of(options),
        )
        counts = _record(config, options.out)
    except (BenchmarkError, EpisodesError, SimBridgeError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("error: interrupted; the same command continues where this one stopped", file=sys.stderr)
        return 130
    print(", ".join(f"{counts[result]} {result.value}" for result in Result) + f": {options.out}")
    return 0


def _record(config: RecordConfig, out: Path) -> Counter[Result]:
    counts: Counter[Result] = Counter()
    with closing(ExpertRecorder(config, out, time.time_ns)) as recorder:
        missing = recorder.missing()
        if there := config.episodes - len(missing):
            print(f"{there} of {config.episodes} episodes are there already: skipped", flush=True)
        for index in missing:
            done = recorder.record(index)
            counts[done.result] += 1
            named = f" as {done.name}" if done.name else ""
            print(
                f"episode {index + 1} of {config.episodes}: {done.result.value}, {done.steps} steps{named}: "
                f"{done.sentence}",
                flush=True,
            )
    return counts


def _sentences(path: Path | None) -> tuple[str, ...]:
    """Read the sentences of a file. Raises OptionError where it can't be read or says nothing."""
    if path is None:
        return ()
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise OptionError(f"cannot read --instructions {path}: {error}") from None
    sentences = tuple(line.strip() for line in lines if line.strip())
    if not sentences:
        raise OptionError(f"--instructions {path} holds no sentence: write one a line")
    return sentences


def _parser() -> argparse.ArgumentParser:
    parser = CommandParser(prog="record", description="Record the expert's demonstrations as bags.")
    parser.add_argument("--task", required=True, help="full name, such as put-blocks-in-bowls-seen-colors")
    parser.add_argument("--split", default="train", help="train, val or test")
    parser.add_argument("--first-seed", type=int, default=0, help="seed of the first episode")
    parser.add_argument("--episodes", type=int, required=True, help="how many scenes")
    parser.add_argument(
        "--instructions", type=Path, metavar="FILE", help="sentences, one a line, that the scenes are made for in turn"
    )
    parser.add_argument("--out", type=Path, required=True, help="data set of episodes; continued if begun")
    add_setup_options(parser)
    add_variation_options(parser)
    return parser


if __name__ == "__main__":
    sys.exit(main())
