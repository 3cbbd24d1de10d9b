"""What the demo says of a task that ended, by the simulator's own judgement."""

from pathlib import Path

import pytest

from cliport_benchmark import demo
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
