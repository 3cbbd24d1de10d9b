"""An experiment's four phases, with its commands played."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from cliport_benchmark import experiment, sweep
from cliport_benchmark.errors import BenchmarkError
from cliport_benchmark.experiment import Experiment, make_data, run_experiment

TASK = "put-blocks-in-bowls-seen-colors"
OTHER = "put-blocks-in-bowls-unseen-colors"


class Commands:
    """The commands of an experiment: train leaves its checkpoints, evaluate its scores."""

    def __init__(self, scores: dict[str, float | None]) -> None:
        self.scores, self.said = scores, list[list[str]]()
        self.left_out: tuple[int, ...] = ()

    def __call__(self, module: str, options: list[str], out: Path, say: Any) -> None:
        self.said.append([module.rpartition(".")[2], *options])
        exact = options[-1:] == ["--exact-offset"]
        options = options[:-1] if exact else options
        given = dict(zip(options[::2], options[1::2], strict=True))
        if module.endswith("train"):
            (out / "checkpoints").mkdir(parents=True, exist_ok=True)
            for step in set(map(int, given["--keep-steps"].split(","))) - set(self.left_out):
                (out / "checkpoints" / f"step-{step:07d}.safetensors").touch()
        elif module.endswith("evaluate_cli"):
            step = given["--checkpoint"].rpartition("step-")[2][:7]
            out.parent.mkdir(parents=True, exist_ok=True)
            values = {"task": given["--task"], "split": given["--split"], "commit": "abc", "n_episodes": 3}
            score = self.scores[f"{given['--split']} {int(step)}{' exact' * exact}"]
            out.write_text(json.dumps({**values, "mean_score": score}))


@pytest.fixture
def commands(monkeypatch: pytest.MonkeyPatch) -> Commands:
    made = Commands({"val 2": 50.0, "val 4": 70.0, "test 4": 65.0, "test 2": 1.0})
    monkeypatch.setattr(experiment, "_run", made)
    monkeypatch.setattr(experiment, "load_card", lambda path: path)
    monkeypatch.setattr(experiment, "method_facts", lambda card: {"method": "CLIPort", "own_encoders": True})
    return made


def test_an_experiment_is_trained_chosen_on_val_and_scored_on_test(tmp_path: Path, commands: Commands) -> None:
    asked = Experiment(TASK, "compact", 7, 4, (4, 2), 5, 6, (OTHER,), train_options=("--batch", "2"))
    path = run_experiment(asked, tmp_path, Path("data"), ["--processes", "3"], lambda _: None)
    assert path == tmp_path / TASK / "compact" / "7-demos" / "experiment.json"
    result = json.loads(path.read_text())
    assert (result["chosen_step"], result["val"], result["n_demos"]) == (4, {"2": 50.0, "4": 70.0}, 7)
    assert result["test"][OTHER]["mean_score"] == result["test"][TASK]["mean_score"] == 65.0
    assert (result["commit"], result["weights_sha256"], result["method"]) == ("abc", None, "CLIPort")
    best = path.parent / "train" / "checkpoints" / "step-0000004.safetensors"
    assert result["checkpoint"] == str(best)
    trained = "train --config compact --data data --n-demos 7 --steps 4 --keep-steps 2,4 --batch 2"
    scored = [
        f"evaluate_cli --checkpoint {best.with_stem(f'step-000000{step}')} --task {task} --split {split} "
        f"--episodes {n} --processes 3"
        for step, task, split, n in (
            (2, TASK, "val", 5),
            (4, TASK, "val", 5),
            (4, TASK, "test", 6),
            (4, OTHER, "test", 6),
        )
    ]
    assert [" ".join(line) for line in commands.said] == [trained, *scored]
    run_experiment(asked, tmp_path, Path("data"), [], lambda _: None)
    assert len(commands.said) == 5, "nothing is made again"


def test_a_finished_experiment_still_gets_its_scores_with_the_exact_offset(tmp_path: Path, commands: Commands) -> None:
    asked = Experiment(TASK, "compact", 7, 4, (4, 2), also_test=(OTHER,))
    path = run_experiment(asked, tmp_path, Path("data"), [], lambda _: None)
    assert "test_exact" not in json.loads(path.read_text())
    before, commands.scores["test 4 exact"] = len(commands.said), 40.0
    for _ in range(2):
        run_experiment(replace(asked, exact_offset=True), tmp_path, Path("data"), [], lambda _: None)
        result = json.loads(path.read_text())
        found = [result[name][task]["mean_score"] for name in ("test", "test_exact") for task in (TASK, OTHER)]
        assert found == [65.0, 65.0, 40.0, 40.0]
    (first, second) = commands.said[before:]
    assert first[-1] == second[-1] == "--exact-offset" and (first[4], second[4]) == (TASK, OTHER)


def test_a_training_that_stopped_and_scenes_without_a_score_are_said(tmp_path: Path, commands: Commands) -> None:
    asked = Experiment(TASK, "compact", 7, 4, (4, 2))
    commands.left_out = (4,)
    with pytest.raises(BenchmarkError, match="training stopped before step 4; run this again to go on"):
        run_experiment(asked, tmp_path, Path("data"), [], lambda _: None)
    commands.left_out, commands.scores = (), {"val 2": None}
    lines = sweep.run_here([(asked, Path("data"))], tmp_path, 1, 2, lambda _: None)
    assert lines == [f"{asked.folder}: no episode of {TASK} val could be scored"]
    assert commands.said[-1][-2:] == ["--processes", "2"]


@pytest.mark.parametrize(("episodes", "whole"), [(5, 10), (10, 10), (11, 20), (21, 21)])
def test_the_smallest_data_that_suffice_are_taken(
    tmp_path: Path, commands: Commands, episodes: int, whole: int
) -> None:
    for name in ("10", "20", "notes"):
        folder = tmp_path / "data" / TASK / name
        folder.mkdir(parents=True)
        (folder / "meta.json").touch()
    found = make_data(TASK, episodes, tmp_path, 3, lambda _: None, ["--camera", "mine.yaml"], "light")
    assert found == tmp_path / "data" / TASK / str(whole)
    (line,) = commands.said
    expected = f"generate_cli --task {TASK} --split train --episodes {whole} --processes 3 --camera mine.yaml"
    assert " ".join(line) == f"{expected} --randomize light"


@pytest.mark.parametrize(
    ("status", "error", "words"),
    [(0, None, ""), (130, KeyboardInterrupt, "^$"), (2, BenchmarkError, "x.y_cli failed with status 2")],
)
def test_the_status_of_a_command_is_heeded(monkeypatch: pytest.MonkeyPatch, status: int, error, words: str) -> None:
    said: list[str] = []
    process = SimpleNamespace(wait=lambda: status)
    monkeypatch.setattr(experiment.subprocess, "Popen", lambda command: process)
    if error is None:
        experiment._run("x.y_cli", ["--a", "b"], Path("out"), said.append)
    else:
        with pytest.raises(error, match=words):
            experiment._run("x.y_cli", ["--a", "b"], Path("out"), said.append)
    assert said == ["y --a b --out out"]
