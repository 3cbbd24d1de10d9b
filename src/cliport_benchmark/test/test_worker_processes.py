"""What the processes beside the main one do, called in this one: preparation, errors as text, experiments at once."""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import cv2
import pytest
import torch

from cliport_benchmark import bench_generation, evaluate, experiment_cli, generate, parallel, sweep, understanding_cli
from cliport_benchmark.agents import POLICY_MODULE
from cliport_benchmark.errors import BenchmarkError
from sim_bridge.errors import SimBridgeError

SEEN, OTHER = "put-blocks-in-bowls-seen-colors", "align-rope"


@pytest.fixture(autouse=True)
def threads() -> Iterator[None]:
    """Many threads to begin with; as many as there were afterwards."""
    kept = cv2.getNumThreads(), torch.get_num_threads()
    cv2.setNumThreads(3)
    torch.set_num_threads(3)
    yield
    cv2.setNumThreads(kept[0])
    torch.set_num_threads(kept[1])


@pytest.mark.parametrize("module", [generate, bench_generation])
def test_a_process_that_makes_scenes_has_one_thread(module: Any) -> None:
    module._set_up()
    assert cv2.getNumThreads() == 1


@pytest.mark.parametrize(("checkpoint", "n"), [("expert", 3), ("default", 1)])
def test_a_process_that_evaluates_has_one_thread_each(monkeypatch: pytest.MonkeyPatch, checkpoint: str, n: int) -> None:
    class Evaluator:
        def __init__(self, config: Any) -> None:
            self.name = config.checkpoint

        def run(self, seed: int) -> str:
            if seed == 13:
                raise SimBridgeError("it flew apart")
            return f"{self.name} {seed}"

    monkeypatch.setattr(evaluate, "_evaluator", None)
    monkeypatch.setattr(evaluate, "Evaluator", Evaluator)
    assert evaluate._run(7) == "the worker was not set up"
    evaluate._set_up(SimpleNamespace(checkpoint=checkpoint))  # type: ignore[arg-type]
    assert (cv2.getNumThreads(), torch.get_num_threads()) == (1, n)
    assert evaluate._run(7) == f"{checkpoint} 7" and evaluate._run(13) == "seed 13: it flew apart"


@pytest.mark.parametrize(
    ("command", "checkpoint", "needed"),
    [
        (evaluate, "expert", ()),
        (evaluate, "default", (POLICY_MODULE,)),
        (understanding_cli, "default", (POLICY_MODULE,)),
    ],
)
def test_processes_that_ask_a_policy_share_its_import(
    monkeypatch: pytest.MonkeyPatch, command: Any, checkpoint: str, needed: tuple[str, ...]
) -> None:
    given: list[Any] = []

    def run_parallel(*arguments: Any, preload: Any = ()) -> Iterator[tuple[int, str]]:
        given.append(preload)
        yield from ()

    monkeypatch.setattr(command, "run_parallel", run_parallel)
    if command is evaluate:
        config = SimpleNamespace(checkpoint=checkpoint, seeds=[])
        assert evaluate.evaluate(config, 2, SimpleNamespace(outcomes={}), given.append) == []  # type: ignore[arg-type]
    else:
        options = SimpleNamespace(
            checkpoint=checkpoint, split="val", survey_colors=False, first_seed=0, episodes=0, processes=1
        )
        assert understanding_cli._examine(options, []) == []  # type: ignore[arg-type]
    assert given == [needed]
    assert hasattr(import_module(POLICY_MODULE), "load_policy")


def test_a_process_without_an_evaluator_says_why_for_each_scene(monkeypatch: pytest.MonkeyPatch) -> None:
    class Fails:
        def __init__(self, config: Any) -> None:
            raise BenchmarkError("no such checkpoint")

    monkeypatch.setattr(evaluate, "_evaluator", None)
    monkeypatch.setattr(evaluate, "Evaluator", Fails)
    evaluate._set_up(SimpleNamespace(checkpoint="expert"))  # type: ignore[arg-type]
    assert evaluate._run(7) == "no such checkpoint"


def test_a_process_leaves_interrupts_to_its_parent_and_ends_with_it(monkeypatch: pytest.MonkeyPatch) -> None:
    told: list[Any] = []
    threads: list[Any] = []
    monkeypatch.setattr(parallel.signal, "signal", lambda *given: told.append(given))
    monkeypatch.setattr(
        parallel.threading,
        "Thread",
        lambda **given: threads.append(given) or SimpleNamespace(start=lambda: told.append("watches")),
    )
    monkeypatch.setenv("OF_THE_COPIED_PROCESS", "older")
    now = {**os.environ, "OF_THE_PARENT": "now"}
    del now["OF_THE_COPIED_PROCESS"]
    monkeypatch.setattr(parallel.os, "environ", os.environ.copy())
    parallel._begin(lambda: told.append("set up"), now)
    assert parallel.os.environ == now
    assert told == [(signal.SIGINT, signal.SIG_IGN), "watches", "set up"]
    assert threads == [{"target": parallel._end_with_parent, "daemon": True}]
    ends: list[Any] = []
    monkeypatch.setattr(parallel.os, "_exit", ends.append)
    for parent in (None, SimpleNamespace(join=lambda: ends.append("parent ended"))):
        monkeypatch.setattr(parallel.multiprocessing, "parent_process", lambda parent=parent: parent)
        parallel._end_with_parent()
    assert ends == ["parent ended", 1]


def test_experiments_at_once_report_what_went_wrong(monkeypatch: pytest.MonkeyPatch) -> None:
    told: list[Any] = []

    def run_experiment(experiment: Any, out: Path, data: Path, options: Any, say: Any) -> None:
        told.append((experiment.folder, out, data, options, say))
        if experiment.folder == "b":
            raise BenchmarkError("no room")

    def run_parallel(function: Any, jobs: Any, at_once: int, set_up: Any) -> Iterator[Any]:
        told.append((len(jobs), at_once))
        set_up()
        for job in jobs:
            yield job, function(job)
        raise BenchmarkError("a process died")

    monkeypatch.setattr(sweep, "run_experiment", run_experiment)
    monkeypatch.setattr(sweep, "run_parallel", run_parallel)
    jobs: Any = [(SimpleNamespace(folder=name), Path("data")) for name in "ab"]
    assert sweep.run_here(jobs, Path("out"), 2, 5, print) == ["b: no room", "a process died"]
    options = ("--processes", "5")
    assert told == [(2, 2), *((name, Path("out"), Path("data"), options, print) for name in "ab")]
    told.clear()
    assert sweep.run_here(jobs, Path("out"), 1, 5, repr) == ["b: no room"]  # type: ignore[arg-type]
    assert told == [(name, Path("out"), Path("data"), options, repr) for name in "ab"]


def command(out: Path, *options: str) -> int:
    return experiment_cli.main(["--task", f"{SEEN},{OTHER}", "--n-demos", "5,9", "--out", str(out), *options])


@pytest.mark.parametrize(("failures", "status"), [([], 0), (["one failed"], 1)])
def test_tasks_share_the_largest_of_their_data(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    failures: list[str],
    status: int,
) -> None:
    made: list[Any] = []
    ran: list[Any] = []

    def make_data(task: str, n: int, out: Path, processes: int, say: Any, setup: Any, randomize: Any) -> Path:
        made.append((task, n, out, processes, tuple(setup), randomize))
        say(f"data of {task}")
        return Path("data") / task

    def run_here(jobs: Any, out: Path, at_once: int, processes: int, say: Any) -> list[str]:
        ran.extend((e.task, e.n_demos, str(data)) for e, data in jobs)
        ran.append((out, at_once, processes))
        return failures

    monkeypatch.setattr(experiment_cli, "make_data", make_data)
    monkeypatch.setattr(experiment_cli, "run_here", run_here)
    monkeypatch.setattr(experiment_cli, "write_report", lambda out: [out / "a.json", out / "a.md"])
    assert command(tmp_path, "--jobs", "3", "--randomize", "light") == status
    assert made == [(task, 9, tmp_path, 2, (), "light") for task in (SEEN, OTHER)]
    assert ran == [*((t, n, f"data/{t}") for t in (SEEN, OTHER) for n in (5, 9)), (tmp_path, 3, 2)]
    said = capsys.readouterr()
    assert said.out == f"== data of {SEEN}\n== data of {OTHER}\n"
    assert said.err == "".join(f"error: {line}\n" for line in failures)
    finished = tmp_path / OTHER / "compact" / "9-demos" / "experiment.json"
    finished.parent.mkdir(parents=True)
    finished.touch()
    assert command(tmp_path) == status
    assert capsys.readouterr().out.splitlines()[2:] == [f"written: {tmp_path / 'a.json'}, {tmp_path / 'a.md'}"]


def test_with_a_cluster_experiments_run_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    told: list[Any] = []

    class Cluster:
        def __enter__(self) -> str:
            return "cluster"

        def __exit__(self, *_: object) -> None:
            told.append("left")

    monkeypatch.setattr(experiment_cli, "join_cluster", lambda *given: told.append(given) or Cluster())
    monkeypatch.setattr(experiment_cli, "make_data", lambda task, *_: Path(task))
    monkeypatch.setattr(
        experiment_cli,
        "run_on_ray",
        lambda cluster, jobs, out, processes, say: told.append((cluster, len(jobs), out, processes)) or [],
    )
    assert command(tmp_path, "--ray", "auto", "--num-gpus", "0.5", "--processes", "4") == 0
    assert told == [("auto", 0.5), ("cluster", 4, tmp_path, 4), "left"]
