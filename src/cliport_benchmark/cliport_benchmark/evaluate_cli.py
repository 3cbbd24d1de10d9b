"""`ros2 run cliport_benchmark evaluate`: the score of the expert or of a policy, in full physics."""

from __future__ import annotations

import argparse
import os
import sys
import time
from pathlib import Path

from cliport_benchmark.agents import EXPERT
from cliport_benchmark.dataset_format import write_json
from cliport_benchmark.episode import Episode
from cliport_benchmark.errors import BenchmarkError, OptionError
from cliport_benchmark.evaluate import EvaluateConfig, evaluate, summary
from cliport_benchmark.provenance import command_line, commit, machine
from cliport_benchmark.wording import Wording, load_patterns, load_synonyms
from cliport_policy.checkpoint import resolve_checkpoint
from cliport_policy.errors import PolicyError
from sim_bridge.errors import SimBridgeError


def main(arguments: list[str] | None = None) -> int:
    """Entry point; 0 when results were written, 1 on an error, 2 on a wrong command line."""
    argv = sys.argv[1:] if arguments is None else arguments
    options = _parser().parse_args(argv)
    start = time.monotonic()
    try:
        config = _config(options)
        _check_writable(options.out)
        episodes = evaluate(config, options.processes, _Progress(config.episodes).report)
        result = summary(config, episodes)
        result |= {
            "wall_s": round(time.monotonic() - start, 1),
            "command": command_line("evaluate", argv),
            "commit": commit(),
            "machine": machine(),
        }
        write_json(options.out, result)
    except (BenchmarkError, SimBridgeError, PolicyError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("error: interrupted; nothing was written", file=sys.stderr)
        return 130
    print(
        f"mean_score {result['mean_score']} (chance {result['chance']}), {result['n_episodes']} episodes of "
        f"{config.task} {config.split}, {result['discarded']} discarded, {result['wall_s']} s; {options.out}"
    )
    return 0


def _config(options: argparse.Namespace) -> EvaluateConfig:
    if options.processes < 1:
        raise OptionError(f"--processes must be 1 or more, got {options.processes}")
    wording = Wording(
        load_patterns(options.phrasings) if options.phrasings else (),
        load_synonyms(options.synonyms) if options.synonyms else {},
    )
    config = EvaluateConfig(
        options.checkpoint,
        options.task,
        options.split,
        options.first_seed,
        options.episodes,
        wording,
    )
    if config.checkpoint != EXPERT:
        resolve_checkpoint(config.checkpoint)
    return config


def _check_writable(path: Path) -> None:
    """Better now than after an hour."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OptionError(f"cannot write --out {path}: {error.strerror or error}") from error
    if path.is_dir():
        raise OptionError(f"cannot write --out {path}: it is a folder; name a file")
    if not os.access(path.parent, os.W_OK) or (path.exists() and not os.access(path, os.W_OK)):
        raise OptionError(f"cannot write --out {path}: permission denied")


class _Progress:
    """Prints a line an episode with the mean so far and the time left."""

    def __init__(self, total: int) -> None:
        self._total = total
        self._done = 0
        self._scores: list[float] = []
        self._start = time.monotonic()

    def report(self, seed: int, episode: Episode | None) -> None:
        self._done += 1
        what = "discarded"
        if episode is not None:
            self._scores.append(episode.score)
            what = f"score {episode.score:.2f} in {episode.steps} steps"
            failures = [s for s in episode.actions if s.outcome != "SUCCEEDED"]
            what += "".join(f", {s.outcome}: {s.message}" for s in failures)
            what += f", {episode.error}" if episode.error else ""
        mean = 100.0 * sum(self._scores) / max(1, len(self._scores))
        eta = (self._total - self._done) * (time.monotonic() - self._start) / self._done
        count = f"[{self._done}/{self._total}]"
        print(f"{count} seed {seed}: {what}; mean {mean:.1f}, ETA {eta / 60:.1f} min", flush=True)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="evaluate", description="Score a policy or the expert.")
    parser.add_argument("--checkpoint", required=True, help="path, name of a shipped one, default, or expert")
    parser.add_argument("--task", required=True, help="full name, such as put-blocks-in-bowls-seen-colors")
    parser.add_argument("--split", default="test", help="train, val or test")
    parser.add_argument("--first-seed", type=int, default=0, help="seed of the first episode")
    parser.add_argument("--episodes", type=int, default=100)
    parser.add_argument("--out", type=Path, required=True, help="JSON file of the results")
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--phrasings", type=Path, help="file of sentence patterns with {block} and {bowl}, one a line")
    parser.add_argument("--synonyms", type=Path, help="file of lines 'colour = word' to say instead")
    return parser


if __name__ == "__main__":
    sys.exit(main())
