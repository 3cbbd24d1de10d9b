"""What an experiment refuses; its four phases run in tests/test_added_task.py."""

from __future__ import annotations

from pathlib import Path

import pytest

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
