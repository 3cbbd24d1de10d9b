"""What the demo says of a task that ended, by the simulator's own judgement."""

from argparse import Namespace
from pathlib import Path

import pytest

from cliport_benchmark import demo
from cliport_benchmark.errors import SceneError
from cliport_benchmark.graph_episode import Played, Progress


@pytest.mark.parametrize("score", [0.995, sum([1 / 6] * 6), 0.5])
def test_a_task_is_done_when_the_simulator_says_so(
    score: float, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    done = score > 0.99  # 99 % of the points of a zone are enough, and sixths do not add up to 1
    played = Played(score, 6, "reached", ("stack it",), True)
    monkeypatch.setattr(demo, "_run", lambda args, out: (Progress(score, done, ""), played))
    assert demo.main(["--out", str(tmp_path)]) == (0 if done else 1)
    assert f"demo: {'success' if done else 'failure'} task=" in capsys.readouterr().out


class Client:
    """A graph's client that notes which scenes are asked for, and refuses those for a sentence when told to."""

    def __init__(self, refuses: bool = False) -> None:
        self.refuses, self.asked = refuses, []

    def reset(self, *scene: object) -> str:
        self.asked.append(scene)
        if self.refuses and len(scene) == 4:
            raise SceneError("there is no such block")
        return "the scene's own sentence"


def test_the_scene_is_made_for_the_instruction_that_is_given() -> None:
    client = Client()
    args = Namespace(task="a-task", seed=3, instruction="")
    assert demo._set_scene(client, args) == "the scene's own sentence"
    args.instruction = "put it there"
    assert demo._set_scene(client, args) == "put it there"
    assert client.asked == [("a-task", "test", 3), ("a-task", "test", 3, "put it there")]


def test_a_word_that_stops_is_nothing_to_show(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        demo.main(["--instruction", "stop!"])
    assert "'stop!' asks for nothing to be done: say what is to be done" in capsys.readouterr().err


def test_an_instruction_that_no_scene_can_be_made_for_gets_the_seeds_own(capsys: pytest.CaptureFixture[str]) -> None:
    client = Client(refuses=True)
    args = Namespace(task="a-task", seed=3, instruction="put it there")
    assert demo._set_scene(client, args) == "put it there"
    assert client.asked[-1] == ("a-task", "test", 3)
    assert "there is no such block; the scene is the seed's own" in capsys.readouterr().out
