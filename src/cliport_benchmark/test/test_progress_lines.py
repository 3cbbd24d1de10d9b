"""What `evaluate` and `record` say while they run."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from cliport_benchmark import record_cli
from cliport_benchmark.episode import Episode, Step
from cliport_benchmark.evaluate import EvaluateConfig
from cliport_benchmark.evaluate_cli import _Progress
from cliport_benchmark.journal import Discarded, Journal
from cliport_benchmark.record import Recorded, Result

TASK = "put-blocks-in-bowls-seen-colors"


def episode(seed: int, score: float) -> Episode:
    return Episode(seed, score, 1, 2, 0, "put it there", None, 1.0, "", ())


def test_each_scene_is_said_with_the_mean_up_to_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    config = EvaluateConfig("expert", TASK, "test", 1, 4)
    progress = _Progress(config, Journal(tmp_path / "results.json", config.settings()))
    for outcome in (Discarded(1, "no place"), episode(2, 1.0), episode(3, 0.5)):
        progress.report(outcome)
    lines = capsys.readouterr().out.splitlines()
    expected = ["[1/4] seed 1: discarded, no place; mean 0.0", "[2/4] seed 2: score 1.00 in 1 steps; mean 100.0"]
    expected.append("[3/4] seed 3: score 0.50 in 1 steps; mean 75.0")
    assert [line.partition(", ETA ")[0] for line in lines] == expected


def test_failures_of_a_kind_are_said_once(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pose = (0.5, 0.0, 0.0)
    failed = "PLANNING_FAILED"
    ends = [("SUCCEEDED", "placed"), (failed, "no way"), ("DROPPED", "lost"), (failed, "too wide")]
    actions = [
        Step("put it there", "pick_place", pose, pose, "", "", True, True, outcome, message, None, 0.5)
        for outcome, message in ends
    ]
    config = EvaluateConfig("expert", TASK, "test", 1, 1)
    progress = _Progress(config, Journal(tmp_path / "results.json", config.settings()))
    progress.report(replace(episode(1, 0.5), steps=4, actions=tuple(actions), error="no more"))
    said = capsys.readouterr().out.partition(" steps, ")[2].partition("; mean")[0]
    assert said == "PLANNING_FAILED 2 times, in the end: too wide, DROPPED: lost, no more"


class Recorder:
    """Records nothing; two demonstrations succeed, and one fails."""

    def __init__(self, *_: object) -> None:
        self.closed = False

    def missing(self) -> list[int]:
        return [0, 1, 2]

    def record(self, index: int) -> Recorded:
        return Recorded(Result.FAILED if index == 1 else Result.SUCCEEDED, "name", 2, "put it there")

    def close(self) -> None:
        self.closed = True


def test_recording_ends_with_a_count_of_each_outcome(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(record_cli, "ExpertRecorder", Recorder)
    assert record_cli.main(["--task", TASK, "--episodes", "3", "--out", str(tmp_path)]) == 0
    assert capsys.readouterr().out.splitlines()[-1] == f"2 succeeded, 1 failed, 0 discarded: {tmp_path}"
