"""`ros2 run cliport_benchmark evaluate`: the score of the expert or of a policy, in full physics."""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Sequence
from contextlib import nullcontext
from pathlib import Path

from cliport_benchmark.episode import Episode, Step
from cliport_benchmark.errors import BenchmarkError, OptionError
from cliport_benchmark.evaluate import EvaluateConfig, evaluate
from cliport_benchmark.journal import Discarded, Journal, Outcome
from cliport_benchmark.json_files import check_writable, write_json
from cliport_benchmark.own_setup import add_setup_options, add_variation_options, setup_of, variation_of
from cliport_benchmark.provenance import command_line, machine
from cliport_benchmark.ray_cluster import RayCluster, join_cluster
from cliport_benchmark.summary import summary
from cliport_benchmark.task_names import task_names
from cliport_benchmark.wording import Wording, load_patterns, load_synonyms
from cliport_core.command_line import CommandParser
from cliport_core.source_state import source_state
from cliport_policy.ablation import PARTS
from cliport_policy.errors import PolicyError
from sim_bridge.errors import SimBridgeError
from sim_bridge.tasks import make_task


def main(arguments: list[str] | None = None) -> int:
    """Run the command; return 0 when all results were written, 1 on an error, 2 on a wrong command line.

    Of several tasks the others are evaluated where one cannot be; what finished of it is kept.
    """
    argv = sys.argv[1:] if arguments is None else arguments
    options = _parser().parse_args(argv)
    failures: list[str] = []
    try:
        work = _prepared(options)
        with join_cluster(options.ray, options.num_gpus) if options.ray else nullcontext() as cluster:
            for config, journal in work:
                try:
                    _evaluate(config, journal, options.processes, command_line("evaluate", argv), cluster)
                except (BenchmarkError, SimBridgeError, PolicyError) as error:
                    if len(work) == 1:
                        raise
                    failures.append(f"{config.task}: {error}")
                    print(f"{config.task} is left out: {error}", file=sys.stderr, flush=True)
    except (BenchmarkError, SimBridgeError, PolicyError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("error: interrupted; the same command continues where this one stopped", file=sys.stderr)
        return 130
    if failures:
        lines = f"{len(failures)} of {len(work)} tasks failed, the same command tries them again"
        print(f"error: {lines}: {'; '.join(failures)}", file=sys.stderr)
    return 1 if failures else 0


def _prepared(options: argparse.Namespace) -> list[tuple[EvaluateConfig, Journal]]:
    """Return every evaluation that is asked for and not complete yet; better refused now than after an hour."""
    if options.processes < 1:
        raise OptionError(f"--processes must be 1 or more, got {options.processes}")
    names = task_names(options.task)
    several = len(names) > 1
    work, source = [], source_state().to_dict()
    for config in [_config(options, name) for name in names]:
        config.setup.check_room(config.task, config.split, config.first_seed)
        out = options.out / f"{config.task}.json" if several else options.out
        check_writable(out)
        journal = Journal(out, config.settings() | source)
        if out.exists() and all(seed in journal.outcomes for seed in config.seeds):
            print(f"{config.task}: {out} is kept, with its {len(journal.outcomes)} scenes")
        else:
            work.append((config, journal))
    return work


def _config(options: argparse.Namespace, task: str) -> EvaluateConfig:
    pattern = make_task(task, options.split).sentence_pattern
    wording = Wording(
        load_patterns(options.phrasings, pattern) if options.phrasings else (),
        load_synonyms(options.synonyms) if options.synonyms else {},
    )
    return EvaluateConfig(
        options.checkpoint,
        task,
        options.split,
        options.first_seed,
        options.episodes,
        wording,
        options.exact_offset,
        setup_of(options),
        variation_of(options),
        options.survey_colors,
        options.without_arm,
        tuple(sorted({part.strip() for part in options.leave_out.split(",")} - {""})),
    )


def _evaluate(
    config: EvaluateConfig, journal: Journal, processes: int, command: str, cluster: RayCluster | None
) -> None:
    """Run what is missing and write the results."""
    start = time.monotonic()
    progress = _Progress(config, journal)
    outcomes = evaluate(config, processes, journal, progress.report, cluster)
    result = summary(journal.settings, outcomes)
    result |= {"wall_s": round(time.monotonic() - start, 1), "command": command, "machine": machine()}
    write_json(journal.out, result)
    journal.remove()
    chance = "" if result["chance"] is None else f" (chance {result['chance']})"
    print(
        f"mean_score {result['mean_score']}{chance}, {result['n_episodes']} episodes of {config.task} {config.split}"
        f"{', without the arm' * config.without_arm}, "
        f"{result['discarded']} discarded, {result['wall_s']} s; {journal.out}"
    )


class _Progress:
    """Prints a line an episode with the mean so far and the time left."""

    def __init__(self, config: EvaluateConfig, journal: Journal) -> None:
        kept = [outcome for seed, outcome in journal.outcomes.items() if seed in config.seeds]
        self._total, self._done, self._new = config.episodes, len(kept), 0
        self._scores = [outcome.score for outcome in kept if isinstance(outcome, Episode)]
        self._start = time.monotonic()
        if kept:
            print(f"continuing {config.task}: {self._done} of {self._total} episodes are there", flush=True)

    def report(self, outcome: Outcome) -> None:
        self._done += 1
        self._new += 1
        if isinstance(outcome, Discarded):
            what = f"discarded, {outcome.reason}"
        else:
            self._scores.append(outcome.score)
            what = f"score {outcome.score:.2f} in {outcome.steps} steps"
        if isinstance(outcome, Episode):
            what += _failures(outcome.actions)
            what += f", {outcome.error}" if outcome.error else ""
        mean = 100.0 * sum(self._scores) / max(1, len(self._scores))
        eta = (self._total - self._done) * (time.monotonic() - self._start) / self._new
        count = f"[{self._done}/{self._total}]"
        print(f"{count} seed {outcome.seed}: {what}; mean {mean:.1f}, ETA {eta / 60:.1f} min", flush=True)


def _failures(actions: Sequence[Step]) -> str:
    """Return which actions failed, as the end of a line: of each outcome how many, and what was said of the last."""
    messages: dict[str, list[str]] = {}
    for action in actions:
        if action.outcome != "SUCCEEDED":
            messages.setdefault(action.outcome, []).append(action.message)
    times = {kind: f" {len(said)} times, in the end" if len(said) > 1 else "" for kind, said in messages.items()}
    return "".join(f", {kind}{times[kind]}: {said[-1]}" for kind, said in messages.items())


def _parser() -> argparse.ArgumentParser:
    parser = CommandParser(prog="evaluate", description="Score a policy or the expert.")
    parser.add_argument(
        "--checkpoint",
        required=True,
        help="path, name of a shipped one, default, expert, or blind (an expert without words)",
    )
    parser.add_argument(
        "--task",
        required=True,
        help="full name, such as put-blocks-in-bowls-seen-colors, several with commas between, "
        "all for the 18 language splits, or demo for the 10 others",
    )
    parser.add_argument("--split", default="test", help="train, val or test")
    parser.add_argument("--first-seed", type=int, default=0, help="seed of the first episode")
    parser.add_argument("--episodes", type=int, default=100)
    parser.add_argument("--out", type=Path, required=True, help="JSON file of the results; a folder for several tasks")
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--ray", metavar="ADDRESS", help="processes of a Ray cluster: an address, auto, or local")
    parser.add_argument("--num-gpus", type=float, default=0.0, help="of each process of the Ray cluster")
    parser.add_argument(
        "--phrasings",
        type=Path,
        help="file of sentence patterns, one a line, with the slots of the task: {block} and {bowl}, say",
    )
    parser.add_argument(
        "--exact-offset",
        action="store_true",
        help="place a thing as far off as it was picked, as the original does, instead of centring the grasp",
    )
    parser.add_argument(
        "--without-arm",
        action="store_true",
        help="set things where they belong, in a tenth of the time; for expert and blind, who know where to hold them",
    )
    parser.add_argument(
        "--leave-out",
        default="",
        metavar="PARTS",
        help=f"parts of the policy's network to act without, with commas between: {', '.join(PARTS)}",
    )
    parser.add_argument("--synonyms", type=Path, help="file of lines 'colour = word' to say instead")
    parser.add_argument(
        "--survey-colors",
        action="store_true",
        help="paint and name the things in colours of a survey, which no demonstration named",
    )
    add_setup_options(parser)
    add_variation_options(parser)
    return parser


if __name__ == "__main__":
    sys.exit(main())
