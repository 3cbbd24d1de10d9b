"""Experiments side by side: in processes of this machine, or over a Ray cluster that shares the folder."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

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


@contextmanager
def ray_cluster(address: str) -> Iterator[Any]:
    """The `ray` module, joined to the cluster at an address, to `auto`'s, or to a `local` one of its own.

    Raises:
        OptionError: when Ray is not installed or its cluster can't be reached.
    """
    try:
        import ray
    except ImportError:
        raise OptionError("--ray needs Ray: python -m pip install ray, or leave --ray out") from None
    try:
        ray.init(address=address, log_to_driver=True)
    except (ConnectionError, RuntimeError, ValueError) as error:
        raise OptionError(f"--ray {address}: no cluster there ({' '.join(str(error).split())[:120]})") from error
    try:
        yield ray
    finally:
        ray.shutdown()


def run_on_ray(ray: Any, jobs: Sequence[Job], out: Path, processes: int) -> list[str]:
    """Run experiments as tasks of so many processors each; what went wrong, a line each."""
    run = ray.remote(num_cpus=processes)(_run)
    tasks = [run.remote(out.resolve(), processes, (experiment, data.resolve())) for experiment, data in jobs]
    lines: list[str] = ray.get(tasks)
    return [line for line in lines if line]


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
