"""Work over Ray, against a stand-in for its module: what is done is kept, whatever becomes of the rest."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from cliport_benchmark import sweep
from cliport_benchmark.errors import BenchmarkError, OptionError
from cliport_benchmark.experiment import Experiment
from cliport_benchmark.parallel import run_parallel
from cliport_benchmark.ray_cluster import RayCluster, join_cluster

TASK = "put-blocks-in-bowls-seen-colors"


class RayActorError(Exception):
    """The actor's process died."""


class RayTaskError(Exception):
    """A task's exception with its place."""

    def __init__(self, cause: Exception) -> None:
        super().__init__(f"Traceback (most recent call last): ... {cause}")
        self.cause = cause


class FakeRay:
    """A stand-in for the module: actors are objects, and what they are asked is done when it is waited for.

    Notes what was reserved and killed; actors with a number in `dying` die at their first task."""

    def __init__(self, dying: tuple[int, ...] = ()) -> None:
        self.exceptions = SimpleNamespace(RayActorError=RayActorError)
        self.dying, self.reserved, self.killed, self.made = dying, {}, [], 0  # type: ignore[var-annotated]

    def init(self, address: str, log_to_driver: bool) -> SimpleNamespace:
        if address == "nowhere":
            raise ConnectionError("no such host")
        return SimpleNamespace(address_info={"gcs_address": "127.0.0.1:1"})

    def shutdown(self) -> None:
        self.made = 0

    def remote(self, **reserved: float) -> Callable[[type], Any]:
        self.reserved = reserved
        return lambda kind: SimpleNamespace(remote=lambda *arguments: self._actor(kind(*arguments)))

    def _actor(self, worker: Any) -> Any:
        number, self.made = self.made, self.made + 1

        def run(*arguments: Any) -> Any:
            if number in self.dying:
                return lambda: _raise(RayActorError("out of memory"))
            return lambda: worker.run(*arguments)

        return SimpleNamespace(run=SimpleNamespace(remote=run), number=number)

    def wait(self, references: list[Any], num_returns: int) -> tuple[list[Any], list[Any]]:
        return references[:num_returns], references[num_returns:]

    def get(self, reference: Callable[[], Any]) -> Any:
        try:
            return reference()
        except RayActorError:
            raise
        except Exception as error:
            raise RayTaskError(error) from error

    def kill(self, actor: Any) -> None:
        self.killed.append(actor.number)


def _raise(error: Exception) -> Any:
    raise error


def cluster(ray: FakeRay, num_gpus: float = 0.0) -> RayCluster:
    return RayCluster(ray, "127.0.0.1:1", num_gpus)


def half(number: int) -> int:
    if number % 2:
        raise ValueError(f"{number} is odd")
    return number // 2


def test_each_worker_is_set_up_once_and_all_items_are_done() -> None:
    ray, prepared = FakeRay(), []
    done = dict(run_parallel(half, [2, 4, 6, 8, 10], 2, lambda: prepared.append(1), cluster(ray, 0.5)))
    assert done == {2: 1, 4: 2, 6: 3, 8: 4, 10: 5} and len(prepared) == 2
    assert ray.reserved == {"num_cpus": 1.0, "num_gpus": 0.5} and set(ray.killed) == {0, 1}


def test_what_finished_is_kept_when_one_item_raises() -> None:
    done = []
    with pytest.raises(BenchmarkError, match=r"^3: ValueError: 3 is odd$"):
        done.extend(run_parallel(half, [2, 3, 4, 6], 1, lambda: None, cluster(FakeRay())))
    assert done == [(2, 1), (4, 2), (6, 3)]


def test_a_worker_that_died_gets_no_further_item() -> None:
    ray, done = FakeRay(dying=(1,)), []
    with pytest.raises(BenchmarkError, match="RayActorError: out of memory"):
        done.extend(run_parallel(half, [2, 4, 6, 8], 2, lambda: None, cluster(ray)))
    assert len(done) == 3
    with pytest.raises(BenchmarkError, match="all Ray workers died with 3 to do"):
        list(run_parallel(half, [2, 4, 6, 8], 1, lambda: None, cluster(FakeRay(dying=(0,)))))


def test_a_closed_loop_leaves_no_worker() -> None:
    ray = FakeRay()
    results = run_parallel(half, [2, 4, 6], 2, lambda: None, cluster(ray))
    next(results)
    results.close()
    assert set(ray.killed) == {0, 1}


def test_joining_says_what_is_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "ray", FakeRay())
    with join_cluster("local", 1.0) as joined:
        assert (joined.address, joined.num_gpus) == ("127.0.0.1:1", 1.0)
    for address, gpus, words in (("nowhere", 0.0, "--ray nowhere: no cluster there"), ("auto", -1.0, "--num-gpus")):
        with pytest.raises(OptionError, match=words), join_cluster(address, gpus):
            pass
    monkeypatch.setitem(sys.modules, "ray", None)
    with pytest.raises(OptionError, match="pip install ray"), join_cluster("auto"):
        pass


def test_a_sweep_trains_side_by_side_and_spreads_the_scenes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """One training raises, one fails: the third is still scored, with seeds over the cluster's GPUs."""
    ray, scored = FakeRay(), []
    jobs = [(Experiment(TASK, "compact", n, 10, (10,)), tmp_path) for n in (1, 2, 3)]

    def train(experiment: Experiment, *rest: Any) -> None:
        if experiment.n_demos == 1:
            raise RuntimeError("the disk is gone")
        if experiment.n_demos == 2:
            raise BenchmarkError("no data")

    def run(experiment: Experiment, out: Path, data: Path, options: tuple[str, ...], say: object) -> None:
        scored.append((experiment.n_demos, " ".join(options)))

    monkeypatch.setattr(sweep, "train_experiment", train)
    monkeypatch.setattr(sweep, "run_experiment", run)
    lines = sweep.run_on_ray(cluster(ray, 1.0), jobs, tmp_path, 4, print)
    assert scored == [(3, "--processes 4 --ray 127.0.0.1:1 --num-gpus 1")]
    assert ray.reserved == {"num_cpus": 4.0, "num_gpus": 1.0} and len(ray.killed) >= 3
    assert len(lines) == 2 and "no data" in lines[0] and "the disk is gone" in lines[1]
