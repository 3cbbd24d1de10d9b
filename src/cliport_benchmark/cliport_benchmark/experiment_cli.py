"""`ros2 run cliport_benchmark experiment`: the paper's four phases for tasks, networks and demonstration counts."""

from __future__ import annotations

import argparse
import itertools
import sys
from collections.abc import Sequence
from contextlib import nullcontext
from pathlib import Path

from cliport_benchmark.comma_lists import whole_numbers
from cliport_benchmark.errors import BenchmarkError, OptionError
from cliport_benchmark.experiment import RESULT_NAME, Experiment, make_data
from cliport_benchmark.experiment_report import write_report
from cliport_benchmark.own_setup import add_setup_options
from cliport_benchmark.ray_cluster import RayCluster, join_cluster
from cliport_benchmark.sweep import run_here, run_on_ray
from cliport_benchmark.task_names import task_names
from cliport_core.command_line import CommandParser
from cliport_policy.errors import PolicyError
from sim_bridge.errors import SimBridgeError


def main(arguments: list[str] | None = None) -> int:
    """Run the command; return 0 when all experiments are done, 1 when one failed, 2 on a wrong command line."""
    options = _parser().parse_args(arguments)
    try:
        if options.processes < 1 or options.jobs < 1:
            raise OptionError(f"--processes {options.processes} and --jobs {options.jobs} must be 1 or more")
        experiments = _experiments(options)
        with join_cluster(options.ray, options.num_gpus) if options.ray else nullcontext() as cluster:
            failures = _run(experiments, options, cluster)
        for line in failures:
            print(f"error: {line}", file=sys.stderr)
        if any((options.out / each.folder / RESULT_NAME).exists() for each in experiments):
            print("written: " + ", ".join(str(path) for path in write_report(options.out)))
        return 1 if failures else 0
    except (BenchmarkError, SimBridgeError, PolicyError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("error: interrupted; the same command continues where this one stopped", file=sys.stderr)
        return 130


def _run(experiments: Sequence[Experiment], options: argparse.Namespace, cluster: RayCluster | None) -> list[str]:
    """Run experiments and return what went wrong, a line each."""
    most = {e.task: max(x.n_demos for x in experiments if x.task == e.task) for e in experiments}
    one = experiments[0]  # set-up and variation are the same in all
    data = {
        task: make_data(task, n, options.out, options.processes, _say, one.setup_options, one.randomize)
        for task, n in most.items()
    }
    jobs = [(experiment, data[experiment.task]) for experiment in experiments]
    if cluster is not None:
        return run_on_ray(cluster, jobs, options.out, options.processes, _say)
    return run_here(jobs, options.out, options.jobs, options.processes, _say)


def _experiments(options: argparse.Namespace) -> list[Experiment]:
    counts, keep = whole_numbers("--n-demos", options.n_demos), whole_numbers("--keep-steps", options.keep_steps or "")
    steps: int = options.steps
    return [
        Experiment(
            task,
            config,
            count,
            steps,
            keep or tuple(sorted({max(1, steps // 4), max(1, steps // 2), steps})),
            options.val_episodes,
            options.test_episodes,
            tuple(task_names(options.also_test)) if options.also_test else (),
            tuple(options.settings),
            tuple(options.train_options.split()),
            options.workspace and str(options.workspace.resolve()),
            options.camera and str(options.camera.resolve()),
            options.randomize,
            options.randomize_scores,
            options.exact_offset,
        )
        for task, config, count in itertools.product(
            task_names(options.task), options.config.split(","), counts or (100,)
        )
    ]


def _say(line: str) -> None:
    print(f"== {line}", flush=True)


def _parser() -> argparse.ArgumentParser:
    parser = CommandParser(
        prog="experiment",
        description="Generate demonstrations, train, choose a checkpoint on val, score it on test; continued if begun.",
    )
    parser.add_argument("--task", required=True, help="full name, or several with commas between")
    parser.add_argument("--config", default="compact", help="network by name or YAML file, or several with commas")
    parser.add_argument("--n-demos", default="100", help="demonstrations to learn from, or several with commas")
    parser.add_argument("--steps", type=int, default=6000, help="training steps")
    parser.add_argument("--keep-steps", help="steps whose checkpoints compete on val; a quarter, half and all")
    parser.add_argument("--val-episodes", type=int, default=100)
    parser.add_argument("--test-episodes", type=int, default=100)
    parser.add_argument("--also-test", help="further tasks to score the chosen checkpoint on: the unseen variant, say")
    parser.add_argument(
        "--set", dest="settings", action="append", default=[], help="a setting of the network, key=value"
    )
    parser.add_argument("--train-options", default="", help="further options of train, in quotes")
    add_setup_options(parser)
    what = "light, texture, clutter, mounting, several with commas between; all without a name"
    for name, scenes in (("--randomize", "demonstrations"), ("--randomize-scores", "scenes that are scored")):
        parser.add_argument(name, nargs="?", const="all", metavar="WHAT", help=f"vary the {scenes}: {what}")
    parser.add_argument(
        "--exact-offset",
        action="store_true",
        help="score the chosen checkpoint on test a second time, with each thing placed as far off as it was picked",
    )
    parser.add_argument("--processes", type=int, default=2, help="for generating and evaluating")
    parser.add_argument("--jobs", type=int, default=1, help="experiments at once on this machine")
    parser.add_argument("--ray", metavar="ADDRESS", help="spread them over Ray: an address, auto, or local")
    parser.add_argument("--num-gpus", type=float, default=0.0, help="of each Ray worker, which trains or evaluates")
    parser.add_argument("--out", type=Path, required=True, help="folder of data, checkpoints and results")
    return parser


if __name__ == "__main__":
    sys.exit(main())
