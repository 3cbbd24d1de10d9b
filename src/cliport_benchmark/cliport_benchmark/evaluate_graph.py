"""`ros2 run cliport_benchmark evaluate_graph`: the policy's score through the whole ROS graph, in real processes."""

from __future__ import annotations

import argparse
import math
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict
from pathlib import Path
from statistics import mean
from typing import Any

from cliport_benchmark.agents import BUILT_IN
from cliport_benchmark.errors import BenchmarkError, OptionError, SceneError
from cliport_benchmark.evaluate import EvaluateConfig
from cliport_benchmark.graph_client import JUDGED_AFTER, GraphClient
from cliport_benchmark.graph_episode import EPISODE_TIMEOUT, play_episode
from cliport_benchmark.graph_process import GraphProcess
from cliport_benchmark.journal import Discarded, GraphEpisode, Journal
from cliport_benchmark.json_files import check_writable, write_json
from cliport_benchmark.provenance import command_line, machine
from cliport_core.command_line import CommandParser
from cliport_core.source_state import source_state
from cliport_policy.errors import PolicyError
from sim_bridge.errors import SimBridgeError

READY_TIMEOUT = 120.0


def main(arguments: list[str] | None = None) -> int:
    """Run the command; return 0 when results were written, 1 on an error."""
    argv = sys.argv[1:] if arguments is None else arguments
    options = _parser().parse_args(argv)
    try:
        config, journal = _prepared(options)
        missing = [seed for seed in config.seeds if seed not in journal.outcomes]
        if missing:
            _run(options, journal, missing)
        result = _result(journal) | {"command": command_line("evaluate_graph", argv), "machine": machine()}
        write_json(options.out, result)
        journal.remove()
    except (BenchmarkError, PolicyError, SimBridgeError, OSError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("error: interrupted; the same command continues where this one stopped", file=sys.stderr)
        return 130
    print(f"mean_score {result['mean_score']} through the graph, {result['n_episodes']} episodes; {options.out}")
    return 0


def _prepared(options: argparse.Namespace) -> tuple[EvaluateConfig, Journal]:
    """Return what is asked for and the episodes that are there already; better refused now than after an hour."""
    config = EvaluateConfig(options.checkpoint, options.task, options.split, options.first_seed, options.episodes)
    if options.checkpoint in BUILT_IN:
        raise OptionError(f"--checkpoint {options.checkpoint} knows the scene, as only evaluate lets it: name a policy")
    if not 0.0 < options.real_time_factor < math.inf:
        raise OptionError(f"--real-time-factor must be positive, got {options.real_time_factor}")
    settings = config.settings() | {"graph": True, "real_time_factor": options.real_time_factor}
    check_writable(options.out)
    return config, Journal(options.out, settings | source_state().to_dict())


def _run(options: argparse.Namespace, journal: Journal, seeds: Sequence[int]) -> None:
    """Run the scenes of the seeds one after another; each is in the journal when the next begins."""
    arguments = {
        "task": options.task,
        "split": options.split,
        "seed": str(seeds[0]),
        "checkpoint": options.checkpoint,
        "real_time_factor": str(options.real_time_factor),
    }
    log = options.out.with_suffix(".log")
    with GraphProcess("sim.launch.yaml", arguments, log) as graph, GraphClient("evaluate_graph") as client:
        client.wait_ready(READY_TIMEOUT, lambda: graph.healthy)
        for seed in seeds:
            try:
                sentence = client.reset(options.task, options.split, seed)
            except SceneError as error:
                journal.add(Discarded(seed, str(error)))
                print(f"seed {seed}: discarded, {error}", flush=True)
                continue
            try:
                episode = _episode(client, seed, sentence, lambda: graph.healthy)
                if not graph.healthy:
                    raise BenchmarkError("the graph ended before the episode was judged")
            except BenchmarkError as error:
                raise BenchmarkError(f"{error} (seed {seed}; see {log})") from error
            journal.add(episode)
            print(f"seed {seed}: score {episode.score:.2f} in {episode.steps} steps: {episode.message}", flush=True)


def _episode(client: GraphClient, seed: int, sentence: str, alive: Callable[[], bool]) -> GraphEpisode:
    time.sleep(1.0)  # a camera frame of the new scene
    start = time.monotonic()
    played = play_episode(client, sentence, client.max_steps, EPISODE_TIMEOUT, alive, JUDGED_AFTER)
    judged = client.judged()
    wall = round(time.monotonic() - start, 1)
    return GraphEpisode(
        seed,
        judged.score,
        played.steps,
        played.sentences,
        played.message,
        wall,
        client.redraws,
        judged.broken,
    )


def _result(journal: Journal) -> dict[str, Any]:
    """Return the results of all outcomes of a journal; the score 0..100, None where every scene was discarded."""
    outcomes = [journal.outcomes[seed] for seed in sorted(journal.outcomes)]
    episodes = [outcome for outcome in outcomes if isinstance(outcome, GraphEpisode)]
    discarded = [outcome for outcome in outcomes if isinstance(outcome, Discarded)]
    return {
        "mean_score": round(100 * mean(e.score for e in episodes), 2) if episodes else None,
        **journal.settings,
        "n_episodes": len(episodes),
        "discarded": len(discarded),
        "redrawn": sum(e.redraws > 0 for e in episodes),
        "redraws": sum(e.redraws for e in episodes),
        "broken": sum(e.broken for e in episodes),
        "episodes": [asdict(episode) for episode in episodes],
        "discarded_episodes": [asdict(scene) for scene in discarded],
    }


def _parser() -> argparse.ArgumentParser:
    parser = CommandParser(prog="evaluate_graph", description="Score a policy through the ROS graph.")
    parser.add_argument("--checkpoint", default="default", help="path, name of a shipped one, or default")
    parser.add_argument("--task", default="put-blocks-in-bowls-seen-colors")
    parser.add_argument("--split", default="test", choices=("train", "val", "test"))
    parser.add_argument("--first-seed", type=int, default=0)
    parser.add_argument("--episodes", type=int, default=10)
    parser.add_argument("--real-time-factor", type=float, default=1.0)
    parser.add_argument("--out", type=Path, required=True)
    return parser


if __name__ == "__main__":
    sys.exit(main())
