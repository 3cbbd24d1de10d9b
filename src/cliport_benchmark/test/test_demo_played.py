"""The demo from its beginning to its end, with the graph played."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from cliport_benchmark import demo
from cliport_benchmark.errors import BenchmarkError
from cliport_benchmark.graph_episode import Played, Progress

TASK = "put-blocks-in-bowls-seen-colors"


class Graph:
    """Graph and client of the demo in one."""

    max_steps, log_path, healthy = 7, "the.log", True

    def __init__(self) -> None:
        self.resets: list[tuple[Any, ...]] = []
        self.started: list[dict[str, str]] = []
        self.refused = self.failing = False

    def __enter__(self) -> Graph:
        return self

    def __exit__(self, *_: object) -> None:
        pass

    def wait_ready(self, timeout: float, alive) -> None:
        assert timeout == 120.0 and alive()

    def reset(self, *arguments: Any) -> str:
        self.resets.append(arguments)
        if self.refused and len(arguments) == 4:
            raise BenchmarkError("it names nothing")
        return "put the red block there"

    def camera_image(self) -> np.ndarray:
        return np.zeros((4, 6, 3), np.uint8)

    def instruct_and_wait(self, text: str, timeout: float, alive) -> SimpleNamespace:
        assert (text, timeout, alive()) == ("do it", 900.0, True)
        return SimpleNamespace(steps=2, message="reached", succeeded=True)

    def judged(self) -> Progress:
        if self.failing:
            raise BenchmarkError("no answer")
        self.on_frame(np.zeros((4, 6, 3), np.uint8))  # type: ignore[attr-defined]
        self.on_status(SimpleNamespace(message="looking"))  # type: ignore[attr-defined]
        self.on_status(SimpleNamespace(message="looking"))  # type: ignore[attr-defined]
        return Progress(0.75, True, "")

    def overlays(self, topic: str) -> list[np.ndarray]:
        return [np.zeros((2, 2, 3), np.uint8)] * 2

    def log_text(self) -> str:
        return "fine\n[sim] error: one\n[sim] error: two\nfine"


@pytest.fixture
def graph(monkeypatch: pytest.MonkeyPatch) -> Graph:
    made = Graph()
    monkeypatch.setattr(demo, "GraphProcess", lambda file, arguments, log: made.started.append(arguments) or made)
    monkeypatch.setattr(demo, "GraphClient", lambda name: made)
    times = iter([float(n) for n in range(99)])
    monkeypatch.setattr(demo, "time", SimpleNamespace(sleep=lambda s: None, monotonic=lambda: next(times)))

    def play(client, first, max_steps, timeout, alive, settle) -> Played:
        assert (first, max_steps, timeout, alive(), settle) == ("put the red block there", 7, 900.0, True, 2.5)
        return Played(0.75, 3, "gave up", (first,), False)

    monkeypatch.setattr(demo, "play_episode", play)
    return made


def test_a_demo_leaves_pictures_and_says_how_it_ended(graph: Graph, tmp_path: Path, capsys) -> None:
    for name in ("old.png", "old.gif", "kept.txt"):
        (tmp_path / name).touch()
    assert demo.main(["--out", str(tmp_path), "--seed", "4"]) == 0
    names = {f"step{step}_{kind}.png" for step in (1, 2) for kind in ("pick", "place")}
    left = {path.name for path in tmp_path.iterdir()}
    assert left == {"before.png", "after.png", "demo.gif", "kept.txt"} | names
    assert capsys.readouterr().out.splitlines() == [
        f"demo: starting the graph (its output: {tmp_path}/graph.log)",
        "demo: instruction: put the red block there",
        "demo: looking",
        f"demo: pictures in {tmp_path}/: before.png, after.png, step*_pick.png, step*_place.png, demo.gif",
        "demo: the policy ended with: gave up",
        f"demo: success task={TASK} seed=4 score=0.75 steps=3 wall_s=1.0",
    ]
    assert graph.resets == [(TASK, "test", 4)]


def test_a_demo_takes_the_default_policy_or_the_one_that_is_named(graph: Graph, tmp_path: Path) -> None:
    for words in ([], ["--checkpoint", "mine"]):
        demo.main(["--out", str(tmp_path), *words])
    assert [started["checkpoint"] for started in graph.started] == ["default", "mine"]


def test_a_demo_of_ones_own_sentence(graph: Graph, tmp_path: Path, capsys) -> None:
    graph.refused = True
    assert demo.main(["--out", str(tmp_path), "--instruction", " do  it"]) == 0
    assert graph.resets == [(TASK, "test", 3, "do it"), (TASK, "test", 3)]
    assert "demo: it names nothing; the scene is the seed's own" in capsys.readouterr().out
    graph.failing = True
    assert demo.main(["--out", str(tmp_path), "--instruction", "do it"]) == 1
    assert capsys.readouterr().err == "error: no answer | [sim] error: two (see the.log)\n"
    (tmp_path / "file").touch()
    assert demo.main(["--out", str(tmp_path / "file" / "x")]) == 1
    assert capsys.readouterr().err.startswith("error: ")
