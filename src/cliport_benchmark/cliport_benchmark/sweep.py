"""Experiments side by side: in processes of this machine, or over a Ray cluster that shares the folder."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

from cliport_benchmark.errors import BenchmarkError
from cliport_benchmark.experiment import Experiment, run_experiment, train_experiment
from cliport_benchmark.parallel import run_parallel
from cliport_benchmark.ray_cluster import RayCluster

Job = tuple[Experiment, Path]  # and where its demonstrations lie


def run_here(jobs: Sequence[Job], out: Path, at_once: int, processes: int, say: Callable[[str], None]) -> list[str]:
    """Run experiments, so many at once with so many processes each; what went wrong, a line each."""
    options = ("--processes", str(processes))
    if at_once == 1:
        return [line for job in jobs if (line := _run(out, options, job, say))]
    lines: list[str] = []
    try:
        for _, line in run_parallel(partial(_run, out, options), jobs, at_once, _nothing):
            lines += [line] if line else []
    except BenchmarkError as error:  # the others are done
        lines.append(str(error))
    return lines


def run_on_ray(
    cluster: RayCluster, jobs: Sequence[Job], out: Path, processes: int, say: Callable[[str], None]
) -> list[str]:
    """Run the experiments' training as Ray workers, each as soon as the cluster
    has a place, and score them one after the other.

    The scenes of an evaluation are spread over so many workers of the cluster. Returns what went wrong, a line each.
    """
    roomy = replace(cluster, num_cpus=float(processes))
    jobs = [(experiment, data.resolve()) for experiment, data in jobs]
    trained: list[Job] = []
    lines: list[str] = []
    try:
        for job, line in run_parallel(partial(_train, out.resolve()), jobs, len(jobs), _nothing, roomy):
            if line:
                lines.append(line)
            else:
                trained.append(job)
    except BenchmarkError as error:  # the others are trained
        lines.append(str(error))
    options = ("--processes", str(processes), "--ray", cluster.address, "--num-gpus", f"{cluster.num_gpus:g}")
    return lines + [line for job in trained if (line := _run(out.resolve(), options, job, say))]


def _train(out: Path, job: Job) -> str:
    """Train one experiment and return why it failed, or an empty line: errors cross processes as text."""
    experiment, data = job
    try:
        train_experiment(experiment, out, data, print)
    except BenchmarkError as error:
        return f"{experiment.folder}: {error}"
    return ""


def _run(out: Path, evaluate_options: Sequence[str], job: Job, say: Callable[[str], None] = print) -> str:
    """Run one; why it failed, or an empty line."""
    experiment, data = job
    try:
        run_experiment(experiment, out, data, evaluate_options, say)
    except BenchmarkError as error:
        return f"{experiment.folder}: {error}"
    return ""


def _nothing() -> None:
    """Workers need no preparation."""
