"""Work spread over processes of one machine, or over a Ray cluster, ended without leftovers whatever ends it.

Processes that the work starts itself are its own to end: `with_parent` starts such that do.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Generator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from typing import TypeVar

from cliport_benchmark.errors import BenchmarkError
from cliport_benchmark.ray_cluster import RayCluster, failure_line
from cliport_benchmark.termination import termination_interrupts

Item = TypeVar("Item")
Result = TypeVar("Result")
_SHOWN = 3  # failures that an error names at most


def run_parallel(
    function: Callable[[Item], Result],
    items: Sequence[Item],
    processes: int,
    set_up: Callable[[], None],
    cluster: RayCluster | None = None,
    preload: Sequence[str] = (),
) -> Generator[tuple[Item, Result]]:
    """Yield (item, function(item)) as they come; each process calls set_up once first. Both must be picklable.

    Processes are copies of one that has imported the function's module and those of `preload`, with one thread each for
    linear algebra: those that share cores must not each start a thread per core. When the caller closes the generator,
    is interrupted or told to terminate, they end at once. With a cluster the processes are Ray actors there. An item
    whose function raises does not end the others: all results come first, then the error.

    Raises:
        BenchmarkError: when a process died; after the last result, when the function raised for an item.
    """
    if not items:
        return
    failures: list[str] = []
    processes = max(1, min(processes, len(items)))
    if cluster is not None:
        yield from cluster.run(function, items, processes, set_up, failures)
    else:
        yield from _run_here(function, items, processes, set_up, failures, preload)
    if failures:
        more = f"; and {len(failures) - _SHOWN} more" if len(failures) > _SHOWN else ""
        raise BenchmarkError("; ".join(failures[:_SHOWN]) + more)


def _run_here(
    function: Callable[[Item], Result],
    items: Sequence[Item],
    processes: int,
    set_up: Callable[[], None],
    failures: list[str],
    preload: Sequence[str],
) -> Generator[tuple[Item, Result]]:
    os.environ["OMP_NUM_THREADS"] = "1"
    context = multiprocessing.get_context("forkserver")  # it lives on: more work needs no new one
    context.set_forkserver_preload([getattr(function, "func", function).__module__, *preload])
    before = set(multiprocessing.active_children())
    pool = ProcessPoolExecutor(processes, mp_context=context, initializer=_begin, initargs=(set_up, dict(os.environ)))
    with termination_interrupts():
        try:
            futures = {pool.submit(function, item): item for item in items}
            for future in as_completed(futures):
                error = future.exception()
                if isinstance(error, BrokenProcessPool):
                    raise error
                if error is not None:
                    failures.append(failure_line(futures[future], error))
                else:
                    yield futures[future], future.result()
            pool.shutdown()
        except BrokenProcessPool:
            raise BenchmarkError("a worker process died: memory may be short, try fewer --processes") from None
        finally:
            pool.shutdown(wait=False, cancel_futures=True)
            for child in set(multiprocessing.active_children()) - before:
                child.terminate()
                child.join(timeout=5.0)


def _begin(set_up: Callable[[], None], environment: Mapping[str, str]) -> None:
    """Prepare a process: an interrupt is the parent's to handle, and without the parent there is nothing to do.

    environment: the parent's variables as they are now; those of the process it is a copy of are older.
    """
    os.environ.clear()
    os.environ.update(environment)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    set_up()


def _end_with_parent() -> None:
    """End with a parent that was killed and so could not end its processes."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)
