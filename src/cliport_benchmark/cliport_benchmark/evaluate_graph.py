"""`ros2 run cliport_benchmark evaluate_graph`: the policy's score through the whole ROS graph, in real processes."""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path
from statistics import mean
from typing import Any

from cliport_benchmark.errors import BenchmarkError
from cliport_benchmark.graph_client import GraphClient
from cliport_benchmark.graph_episode import play_episode
from cliport_benchmark.graph_process import GraphProcess
from cliport_benchmark.json_files import write_json
from cliport_benchmark.policy_facts import policy_facts
from cliport_benchmark.provenance import command_line, machine
from cliport_core.command_line import CommandParser
from cliport_core.source_state import source_state
from cliport_policy.errors import PolicyError

READY_TIMEOUT = 120.0
GOAL_TIMEOUT = 900.0  # of an episode [s]: twenty actions


def main(arguments: list[str] | None = None) -> int:
    """Run the command; return 0 when results were written, 1 on an error."""
    argv = sys.argv[1:] if arguments is None else arguments
    options = _parser().parse_args(argv)
    try:
        facts = policy_facts(options.checkpoint) | source_state().to_dict()
        episodes = _run(options)
    except (BenchmarkError, PolicyError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    result = {
        "mean_score": round(100 * mean(e["score"] for e in episodes), 2),
        "task": options.task,
        "split": options.split,
        "checkpoint": options.checkpoint,
        "graph": True,
        "first_seed": options.first_seed,
        "n_episodes": len(episodes),
        "command": command_line("evaluate_graph", argv),
        **facts,
        "machine": machine(),
        "episodes": episodes,
    }
    options.out.parent.mkdir(parents=True, exist_ok=True)
    write_json(options.out, result)
    print(f"mean_score {result['mean_score']} through the graph, {len(episodes)} episodes; {options.out}")
    return 0


def _run(options: argparse.Namespace) -> list[dict[str, Any]]:
    arguments = {
        "task": options.task,
        "split": options.split,
        "seed": str(options.first_seed),
        "checkpoint": options.checkpoint,
        "real_time_factor": str(options.real_time_factor),
    }
    log = options.out.with_suffix(".log")
    episodes = []
    with GraphProcess("sim.launch.yaml", arguments, log) as graph, GraphClient("evaluate_graph") as client:
        client.wait_ready(READY_TIMEOUT, lambda: graph.healthy)
        for seed in range(options.first_seed, options.first_seed + options.episodes):
            sentence = client.reset(options.task, options.split, seed)
            time.sleep(1.0)
            start = time.monotonic()
            played = play_episode(client, sentence, client.max_steps, GOAL_TIMEOUT)
            if not graph.healthy:
                raise BenchmarkError(f"the graph ended in seed {seed} (see {log})")
            time.sleep(1.0)  # what was let go comes to rest
            episode = {
                "seed": seed,
                "score": client.score(),
                "steps": played.steps,
                "instructions": list(played.sentences),
                "message": played.message,
                "wall_s": round(time.monotonic() - start, 1),
            }
            episodes.append(episode)
            print(f"seed {seed}: score {episode['score']:.2f} in {played.steps} steps: {played.message}", flush=True)
    return episodes


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
