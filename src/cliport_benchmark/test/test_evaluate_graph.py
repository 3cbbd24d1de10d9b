"""Evaluation through the graph, with a fake graph: what is refused, and what an interruption leaves."""

import json
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from cliport_benchmark import evaluate_graph
from cliport_benchmark.errors import BenchmarkError, SceneError
from cliport_benchmark.graph_episode import Played, Progress

SEEN = "put-blocks-in-bowls-seen-colors"


class FakeGraph:
    """Graph and client in one: each seed's score is seed / 10; `failure` comes in seed 2, once."""

    def __init__(self) -> None:
        self.healthy, self.max_steps, self.redraws = True, 4, 0
        self.failure: BaseException | None = None
        self.resets: list[int] = []
        self.awaited: list[tuple[float, bool]] = []
        self.settled: list[float] = []
        self.dies_in = self.stopped_in = 0  # seeds

    def __enter__(self) -> "FakeGraph":
        return self

    def __exit__(self, *_: object) -> None:
        pass

    def wait_ready(self, timeout: float, alive: Callable[[], bool]) -> None:
        self.awaited.append((timeout, alive()))

    def reset(self, task: str, split: str, seed: int) -> str:
        self.resets.append(seed)
        self.redraws = 2 * (seed == 1)
        if seed == 3:
            raise SceneError("no free place")
        if seed == 2 and self.failure is not None:
            failure, self.failure = self.failure, None
            raise failure
        return "put it there"

    def judged(self) -> Progress:
        return Progress(self.resets[-1] / 10, False, "put it there", self.resets[-1] == 2)


@pytest.fixture
def graph(monkeypatch: pytest.MonkeyPatch) -> FakeGraph:
    fake = FakeGraph()
    monkeypatch.setattr(evaluate_graph, "GraphProcess", lambda *_: fake)
    monkeypatch.setattr(evaluate_graph, "GraphClient", lambda name: fake)
    monkeypatch.setattr(evaluate_graph, "time", SimpleNamespace(sleep=lambda s: None, monotonic=lambda: 0.0))

    def play(client: FakeGraph, first: str, max_steps: int, timeout: float, alive, settle: float) -> Played:
        assert (client, first, max_steps, timeout, alive()) == (fake, "put it there", 4, 900.0, True)
        fake.settled.append(settle)
        if fake.resets[-1] == fake.dies_in:
            fake.healthy = False
        if fake.resets[-1] == fake.stopped_in:
            raise BenchmarkError("somebody stopped the policy: stopped")
        return Played(0.0, 2, "reached", ("put it there",), True)

    monkeypatch.setattr(evaluate_graph, "play_episode", play)
    return fake


def arguments(out: Path | str, **changes: Any) -> list[str]:
    options = {"task": SEEN, "first-seed": 1, "episodes": 3, "out": out} | changes
    return [part for name, value in options.items() for part in (f"--{name}", str(value))]


@pytest.mark.parametrize(
    ("failure", "status"), [(BenchmarkError("the score did not come"), 1), (KeyboardInterrupt(), 130)]
)
def test_what_was_scored_before_a_failure_is_kept(
    graph: FakeGraph, failure: BaseException, status: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "graph.json"
    graph.failure = failure
    assert evaluate_graph.main(arguments(out)) == status
    assert capsys.readouterr().err.count("\n") == 1 and not out.exists()
    assert evaluate_graph.main(arguments(out)) == 0
    assert graph.resets == [1, 2, 2, 3]
    assert graph.awaited == [(evaluate_graph.READY_TIMEOUT, True)] * 2
    result = json.loads(out.read_text())
    assert [(e["seed"], e["score"]) for e in result["episodes"]] == [(1, 0.1), (2, 0.2)]
    assert result["discarded_episodes"] == [{"seed": 3, "reason": "no free place"}]
    assert (result["mean_score"], result["n_episodes"], result["graph"], result["offset"]) == (15.0, 2, True, "centred")
    assert (result["redrawn"], result["redraws"], result["broken"]) == (1, 2, 1)
    assert {"workspace", "camera", "object_set", "weights_sha256"} <= set(result)
    assert [path.name for path in tmp_path.iterdir()] == ["graph.json"]
    assert evaluate_graph.main(arguments(out, episodes=4)) == 0
    assert graph.resets == [1, 2, 2, 3, 4]  # the finished ones are not run again


@pytest.mark.parametrize(
    ("fault", "words"),
    [
        ("dies_in", "the graph ended before the episode was judged"),
        ("stopped_in", "somebody stopped the policy: stopped"),
    ],
)
def test_an_episode_that_was_cut_off_is_no_result(
    graph: FakeGraph, fault: str, words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "graph.json"
    setattr(graph, fault, 2)
    assert evaluate_graph.main(arguments(out, episodes=2, **{"real-time-factor": 2})) == 1
    error = capsys.readouterr().err
    assert error.startswith(f"error: {words} (seed 2; see ") and error.count("\n") == 1
    setattr(graph, fault, 0)
    graph.healthy = True
    assert evaluate_graph.main(arguments(out, episodes=2, **{"real-time-factor": 2})) == 0
    assert graph.resets == [1, 2, 2] and graph.settled == [2.5] * 3


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"episodes": 0}, "--episodes must be 1 or more, got 0"),
        ({"first-seed": -1}, "--first-seed must be 0 or more"),
        ({"real-time-factor": 0}, "--real-time-factor must be positive"),
        ({"checkpoint": "expert"}, "name a policy"),
        ({"task": "juggling"}, "unknown task 'juggling'"),
        ({"out": "/proc/none/graph.json"}, "cannot write --out /proc/none/graph.json"),
    ],
)
def test_bad_input_is_one_line_before_the_graph_starts(
    graph: FakeGraph, changes: dict[str, Any], message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert evaluate_graph.main(arguments(**({"out": tmp_path / "graph.json"} | changes))) == 1
    error = capsys.readouterr().err
    assert error.startswith("error: ") and message in error and error.count("\n") == 1
    assert not graph.resets
