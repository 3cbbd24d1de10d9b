"""Experiments side by side: in processes of this machine, or over a Ray cluster that shares the folder."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

from cliport_benchmark.errors import BenchmarkError, OptionError
from cliport_benchmark.experiment import Experiment, run_experiment
from cliport_benchmark.parallel import run_parallel

Job = tuple[Experiment, Path]  # and where its demonstrations lie


def run_here(jobs: Sequence[Job], out: Path, at_once: int, processes: int, say: Callable[[str], None]) -> list[str]:
    """Run experiments, so many at once with so many processes each; what went wrong, a line each."""
    if at_once == 1:
        return [line for job in jobs if (line := _run(out, processes, job, say))]
    failures = run_parallel(partial(_run, out, processes), jobs, at_once, _nothing)
    return [line for _, line in failures if line]


def run_on_ray(jobs: Sequence[Job], out: Path, address: str, processes: int) -> list[str]:
    """Run experiments as Ray tasks of so many processors each.

    Raises:
        OptionError: when Ray is not installed or its cluster can't be reached.
    """
    try:
        import ray
    except ImportError:
        raise OptionError("--ray needs Ray: python -m pip install ray, or leave --ray out") from None
    try:
        ray.init(address=None if address == "local" else address, log_to_driver=True)
    except (ConnectionError, RuntimeError, ValueError) as error:
        raise OptionError(f"--ray {address}: no cluster there ({' '.join(str(error).split())[:120]})") from error
    try:
        remote = ray.remote(num_cpus=processes)(partial(_run, out.resolve(), processes))
        lines: list[str] = ray.get([remote.remote((job, data.resolve())) for job, data in jobs])
        return [line for line in lines if line]
    finally:
        ray.shutdown()


def _run(out: Path, processes: int, job: Job, say: Callable[[str], None] = print) -> str:
    """Run one; why it failed, or an empty line: errors cross processes as text."""
    experiment, data = job
    try:
        run_experiment(experiment, out, data, processes, say)
    except BenchmarkError as error:
        return f"{experiment.folder}: {error}"
    return ""


def _nothing() -> None:
    """Workers need no preparation."""
