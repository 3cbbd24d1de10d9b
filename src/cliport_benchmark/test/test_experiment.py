"""The four phases for real, as small as they can be: data, training, validation and test by the arm in physics."""

from __future__ import annotations

from pathlib import Path

import pytest

from cliport_benchmark.experiment_cli import main
from cliport_benchmark.json_files import read_json

TASK = "put-blocks-in-bowls-seen-colors"


def command(out: Path) -> list[str]:
    options = f"--task {TASK} --n-demos 2 --steps 2 --keep-steps 2 --val-episodes 1 --test-episodes 1 --processes 1"
    return [*options.split(), "--train-options", "--batch 2 --phrases 0", "--out", str(out)]


def test_four_phases_end_in_a_table_and_are_not_done_twice(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    assert main(command(tmp_path)) == 0
    said = [line.split()[1] for line in capfd.readouterr().out.splitlines() if line.startswith("== ")]
    assert said == ["generate", "train", "evaluate", "evaluate"]
    folder = tmp_path / TASK / "compact" / "2-demos"
    result = read_json(folder / "experiment.json")
    assert result["chosen_step"] == 2 and set(result["val"]) == {"2"}
    assert read_json(folder / "val" / "step-0000002.json")["split"] == "val"
    test = read_json(folder / "test" / f"{TASK}.json")
    assert test["split"] == "test" and result["test"][TASK]["mean_score"] == test["mean_score"]
    assert TASK in (tmp_path / "experiments.md").read_text()
    weights = (folder / "train" / "policy.safetensors").stat().st_mtime_ns
    assert main(command(tmp_path)) == 0
    said = [line.split()[1] for line in capfd.readouterr().out.splitlines() if line.startswith("== ")]
    assert said == ["generate"]  # which finds that all is there
    assert (folder / "train" / "policy.safetensors").stat().st_mtime_ns == weights


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (["--task", "put-blocks-in-bowls"], "did you mean put-blocks-in-bowls-full"),
        (["--config", "cliprot"], "did you mean 'cliport'"),
        (["--n-demos", "ten"], "--n-demos must be whole numbers"),
        (["--keep-steps", "9"], "--keep-steps must be within 1 and --steps 2"),
        (["--train-options", "--batch nought"], "status 2"),
        (["--ray", "auto"], "--ray"),
    ],
)
def test_bad_input_is_one_clear_line(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], change: list[str], words: str
) -> None:
    assert main([*command(tmp_path), *change]) == 1
    lines = [line for line in capfd.readouterr().err.splitlines() if line.startswith("error: ")]
    assert len(lines) == 1 and words in lines[0]
