"""A Ray cluster as a place for parallel work. Ray is an optional extra; its nodes share the folder of results."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, TypeVar

from cliport_benchmark.errors import BenchmarkError, OptionError

Item = TypeVar("Item")
Result = TypeVar("Result")


@dataclass(frozen=True)
class RayCluster:
    """A cluster that this process has joined.

    ray: the module. address: at which other processes join it too. num_gpus: that each worker reserves, 0.5 for half.
    num_cpus: likewise.
    """

    ray: Any
    address: str
    num_gpus: float = 0.0
    num_cpus: float = 1.0

    def run(
        self,
        function: Callable[[Item], Result],
        items: Sequence[Item],
        workers: int,
        set_up: Callable[[], None],
        failures: list[str],
    ) -> Generator[tuple[Item, Result]]:
        """Yield (item, function(item)) as they come from so many actors, each of which calls set_up once first.

        failures: gets a line for each item whose function raised, or whose worker died.

        Raises:
            BenchmarkError: when all workers died.
        """
        ray = self.ray
        remote = ray.remote(num_cpus=self.num_cpus, num_gpus=self.num_gpus)(_Worker)
        actors = [remote.remote(set_up) for _ in range(workers)]
        idle, waiting = list(actors), deque(items)
        running: dict[Any, tuple[Any, Item]] = {}
        try:
            while waiting or running:
                while idle and waiting:
                    actor, item = idle.pop(), waiting.popleft()
                    running[actor.run.remote(function, item)] = actor, item
                if not running:
                    raise BenchmarkError(f"all Ray workers died with {len(waiting)} to do: {failures[-1]}")
                (ready, *_), _ = ray.wait(list(running), num_returns=1)
                actor, item = running.pop(ready)
                try:
                    result = ray.get(ready)
                except ray.exceptions.RayActorError as error:  # it is not given another item
                    failures.append(failure_line(item, error))
                    continue
                except Exception as error:
                    failures.append(failure_line(item, error))
                else:
                    yield item, result
                if waiting:
                    idle.append(actor)
                else:
                    ray.kill(actor)  # its processors and GPUs are for those that wait for some
        finally:
            for actor in actors:
                ray.kill(actor)  # also one that is dead already


class _Worker:
    """An actor's process."""

    def __init__(self, set_up: Callable[[], None]) -> None:
        set_up()

    def run(self, function: Callable[[Item], Result], item: Item) -> Result:
        """Apply the function to one item."""
        return function(item)


@contextmanager
def join_cluster(address: str, num_gpus: float = 0.0, num_cpus: float = 1.0) -> Iterator[RayCluster]:
    """Join the cluster at an address, that of `auto`, or a `local` one of this process's own.

    Raises:
        OptionError: when Ray is not installed or its cluster can't be reached.
    """
    if num_gpus < 0:
        raise OptionError(f"--num-gpus must be 0 or more, got {num_gpus:g}")
    try:
        import ray
    except ImportError:
        raise OptionError("--ray needs Ray: python -m pip install ray, or leave --ray out") from None
    try:
        context = ray.init(address=address, log_to_driver=True)
    except (ConnectionError, RuntimeError, ValueError) as error:
        raise OptionError(f"--ray {address}: no cluster there ({' '.join(str(error).split())[:120]})") from error
    try:
        yield RayCluster(ray, str(context.address_info["gcs_address"]), num_gpus, num_cpus)
    finally:
        ray.shutdown()


def failure_line(item: object, error: BaseException) -> str:
    """Return one line that says which item failed and how; Ray wraps what was raised together with a traceback."""
    cause = getattr(error, "cause", None) or error
    text = " ".join(str(cause).split())
    return f"{str(item)[:60]}: {type(cause).__name__}: {text[:200]}"
