"""`ros2 run cliport_benchmark generate`: expert demonstrations from the simulated camera."""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

from cliport_benchmark.errors import BenchmarkError, OptionError
from cliport_benchmark.generate import GenerateConfig, Mode, PartReport, generate
from cliport_benchmark.own_setup import add_setup_options, add_variation_options, setup_of, variation_of
from cliport_benchmark.provenance import command_line
from cliport_core.command_line import CommandParser
from cliport_core.source_state import source_state
from cliport_policy.errors import PolicyError
from sim_bridge.errors import SimBridgeError
from sim_bridge.tasks import ALIASES


def main(arguments: list[str] | None = None) -> int:
    """Run the command; return 0 when all parts are there, 1 on an error, 2 on a wrong command line."""
    argv = sys.argv[1:] if arguments is None else arguments
    options = _parser().parse_args(argv)
    try:
        if options.processes < 1:
            raise OptionError(f"--processes must be 1 or more, got {options.processes}")
        if options.first_parts is not None and options.first_parts < 1:
            raise OptionError(f"--first-parts must be 1 or more, got {options.first_parts}")
        config = GenerateConfig(
            ALIASES.get(options.task, options.task),
            options.split,
            options.first_seed,
            options.episodes,
            options.goals_per_scene,
            Mode(options.mode),
            variation_of(options),
            setup_of(options),
            options.mistakes,
        )
        progress = _Progress(config)
        provenance = {"command": command_line("generate", argv), **source_state().to_dict()}
        generate(config, options.out, options.processes, provenance, progress.report, options.first_parts)
    except (BenchmarkError, PolicyError, SimBridgeError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("error: interrupted; the same command continues where this one stopped", file=sys.stderr)
        return 130
    print(f"{min(options.first_parts or config.n_parts, config.n_parts)} parts complete in {options.out}")
    return 0


class _Progress:
    """Prints rate and time left after each part."""

    def __init__(self, config: GenerateConfig) -> None:
        self._n_parts = config.n_parts
        self._start = time.monotonic()
        self._parts = self._observations = self._discarded = 0

    def report(self, part: PartReport, left: int) -> None:
        self._parts += 1
        self._observations += part.observations
        self._discarded += part.discarded
        seconds = max(time.monotonic() - self._start, 1e-6)
        eta = left * seconds / self._parts
        print(
            f"part {self._n_parts - left}/{self._n_parts}: {self._observations} observations, "
            f"{self._observations / seconds:.1f}/s, {self._discarded} episodes discarded, "
            f"ETA {eta / 60:.1f} min",
            flush=True,
        )


def _parser() -> argparse.ArgumentParser:
    parser = CommandParser(prog="generate", description="Make expert demonstrations.")
    parser.add_argument("--task", required=True, help="full name, such as put-blocks-in-bowls-seen-colors")
    parser.add_argument("--split", default="train", help="train, val or test")
    parser.add_argument("--first-seed", type=int, default=0, help="seed of the first episode")
    parser.add_argument("--episodes", type=int, required=True, help="how many scenes")
    parser.add_argument("--out", type=Path, required=True, help="folder of the data set; continued if begun")
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--first-parts", type=int, help="make only the first files now; without it, the rest, too")
    parser.add_argument("--goals-per-scene", type=int, default=1, help="goals asked for in each observation")
    parser.add_argument("--mode", choices=[m.value for m in Mode], default=Mode.FAST.value)
    parser.add_argument(
        "--mistakes",
        type=float,
        default=0.0,
        help="share of the actions before which a mistake is made, then put right",
    )
    add_setup_options(parser)
    add_variation_options(parser)
    return parser


if __name__ == "__main__":
    sys.exit(main())
