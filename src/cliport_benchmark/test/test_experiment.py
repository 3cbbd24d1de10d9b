"""What an experiment refuses; its four phases run in tests/test_added_task.py."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest

from cliport_benchmark.errors import OptionError
from cliport_benchmark.experiment import Experiment, train_experiment
from cliport_benchmark.experiment_cli import main

TASK = "put-blocks-in-bowls-seen-colors"


def command(out: Path) -> list[str]:
    options = f"--task {TASK} --n-demos 2 --steps 2 --keep-steps 2 --val-episodes 1 --test-episodes 1 --processes 1"
    return [*options.split(), "--train-options", "--batch 2 --phrases 0", "--out", str(out)]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (["--task", "put-blocks-in-bowls"], "did you mean put-blocks-in-bowls-full"),
        (["--config", "cliprot"], "did you mean 'cliport'"),
        (["--n-demos", "ten"], "--n-demos must be whole numbers"),
        (["--keep-steps", "9"], "--keep-steps must be within 1 and --steps 2"),
        (["--train-options", "--batch nought"], "--train-options '--batch nought' are not what train takes"),
        (["--ray", "auto"], "--ray"),
    ],
)
def test_bad_input_is_one_clear_line(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], change: list[str], words: str
) -> None:
    assert main([*command(tmp_path), *change]) == 1
    lines = [line for line in capfd.readouterr().err.splitlines() if line.startswith("error: ")]
    assert len(lines) == 1 and words in lines[0]


def test_training_goes_on_in_the_folder_of_the_same_settings_only(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    trained: list[Path] = []
    monkeypatch.setattr("cliport_benchmark.experiment._train", lambda _, folder, *__: trained.append(folder))
    experiment = Experiment(task=TASK, config="compact", n_demos=2, steps=4, keep_steps=(4,))
    folder = tmp_path / experiment.folder
    for _ in range(2):
        train_experiment(experiment, tmp_path, tmp_path / "data", lambda _: None)
    assert trained == [folder / "train"] * 2
    assert json.loads((folder / "settings.json").read_text())["steps"] == 4
    longer = replace(experiment, steps=5)
    with pytest.raises(OptionError, match=r"holds an experiment of other settings \(steps 4 not 5\)"):
        train_experiment(longer, tmp_path, tmp_path / "data", lambda _: None)
    assert len(trained) == 2
