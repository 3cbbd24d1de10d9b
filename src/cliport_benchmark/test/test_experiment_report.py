"""What experiments leave for people: a table beside the paper's numbers, and a plot."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import cv2
import pytest

from cliport_benchmark.errors import DataFolderError, OptionError
from cliport_benchmark.experiment import Experiment, choose
from cliport_benchmark.experiment_report import write_report
from cliport_benchmark.json_files import write_json

TASK = "put-blocks-in-bowls-seen-colors"


def result(method: str, n_demos: int, score: float) -> dict[str, Any]:
    test = {"mean_score": score, "chance": 20.0, "n_episodes": 100, "command": "evaluate"}
    return {
        "method": method,
        "n_demos": n_demos,
        "val": {"500": 80.0, "1000": 90.0},
        "chosen_step": 1000,
        "test": {TASK: test},
    }


def test_scores_stand_beside_the_papers(tmp_path: Path) -> None:
    for method, n_demos, score in (("compact", 10, 55.5), ("transporter", 100, 22.25), ("compact", 100, 99.0)):
        write_json(tmp_path / TASK / method / f"{n_demos}-demos" / "experiment.json", result(method, n_demos, score))
    json_path, table_path, plot_path = write_report(tmp_path)
    rows = [line.split(" | ") for line in table_path.read_text().splitlines() if line.startswith(f"| {TASK}")]
    assert [(r[1], r[2], r[3]) for r in rows] == [
        ("compact", "10", "55.5"),
        ("compact", "100", "99.0"),
        ("transporter", "100", "22.2"),
    ]
    assert [r[8] for r in rows] == ["73.0", "98.2", "63.2"]
    assert rows[2][9].startswith("Transporter-only")
    assert json_path.read_text().count('"method"') == 3
    assert cv2.imread(str(plot_path)).shape[1] > 500


def test_nothing_and_damaged_results_are_refused(tmp_path: Path) -> None:
    with pytest.raises(DataFolderError, match="no finished experiment"):
        write_report(tmp_path)
    write_json(tmp_path / TASK / "compact" / "1-demos" / "experiment.json", {"method": "compact"})
    with pytest.raises(DataFolderError, match="damaged"):
        write_report(tmp_path)


def test_the_first_of_the_best_is_chosen() -> None:
    assert choose([100, 200, 300], [0.5, 0.9, 0.9]) == 200


def test_what_makes_no_experiment_is_refused() -> None:
    with pytest.raises(OptionError, match="--keep-steps"):
        Experiment(TASK, "compact", 10, steps=100, keep_steps=(200,))
    with pytest.raises(OptionError, match="--n-demos"):
        Experiment(TASK, "compact", 0, steps=100, keep_steps=(100,))
