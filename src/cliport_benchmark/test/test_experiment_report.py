"""What experiments leave for people: a table beside the paper's numbers, and a plot."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import cv2
import pytest
from matplotlib.figure import Figure

from cliport_benchmark.errors import DataFolderError, OptionError
from cliport_benchmark.experiment import Experiment, choose
from cliport_benchmark.experiment_report import write_report
from cliport_benchmark.json_files import write_json
from cliport_benchmark.paper_scores import paper_scores

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


def rows_of(path: Path) -> list[list[str]]:
    return [[c.strip() for c in line.split("|")[1:-1]] for line in path.read_text().splitlines()[2:] if "|" in line]


def write(out: Path, method: str, n_demos: int, score: float, **values: Any) -> None:
    path = out / TASK / method / f"{n_demos}-demos" / "experiment.json"
    write_json(path, result(method, n_demos, score) | values)


def test_scores_stand_beside_the_papers(tmp_path: Path) -> None:
    for method, n_demos, score in (("compact", 10, 55.5), ("transporter", 100, 22.25), ("compact", 100, 99.0)):
        write(tmp_path, method, n_demos, score)
    json_path, table_path, plot_path = write_report(tmp_path)
    rows = rows_of(table_path)
    assert [(r[1], r[2], r[3]) for r in rows] == [
        ("compact", "10", "55.5"),
        ("compact", "100", "99.0"),
        ("transporter", "100", "22.2"),
    ]
    for row, method in zip(rows, ["CLIPORT (single)", "CLIPORT (single)", "Transporter-only"], strict=True):
        test, val = (paper_scores()[table, method, TASK, int(row[2])] for table in ("1", "4"))
        assert [row[5], row[9], row[11]] == [f"{test:.1f}", f"{val:.1f}", method]
    assert json_path.read_text().count('"method"') == 3
    assert cv2.imread(str(plot_path)).shape == (660, 600, 3)  # 5 x 5.5 inches a task, of 120 pixels


def test_both_offsets_stand_beside_each_other(tmp_path: Path) -> None:
    write(tmp_path, "compact", 10, 97.0, test_exact={TASK: {"mean_score": 81.25}})
    write(tmp_path, "compact", 100, 99.0)
    assert [row[2:5] for row in rows_of(write_report(tmp_path)[1])] == [["10", "97.0", "81.2"], ["100", "99.0", ""]]


def test_scenes_that_were_not_as_drawn_are_counted(tmp_path: Path) -> None:
    write(tmp_path, "compact", 10, 97.0)
    counted = result("x", 100, 50.0)["test"][TASK] | {"discarded": 1, "redrawn": 2, "broken": 3}
    write(tmp_path, "compact", 100, 50.0, test={TASK: counted})
    assert [row[12:] for row in rows_of(write_report(tmp_path)[1])] == [["unknown"] * 3, ["1", "2", "3"]]


def test_a_test_whose_scenes_were_all_discarded_leaves_its_cell_empty(tmp_path: Path) -> None:
    write(tmp_path, "compact", 100, 50.0)
    nothing = result("x", 10, 0.0)["test"][TASK] | {"mean_score": None, "n_episodes": 0}
    write(tmp_path, "compact", 10, 0.0, test={TASK: nothing})
    rows = rows_of(write_report(tmp_path)[1])
    assert [(row[2], row[3]) for row in rows] == [("10", ""), ("100", "50.0")]


def test_a_row_is_found_by_the_configs_stem_and_not_for_other_encoders(tmp_path: Path) -> None:
    write(tmp_path, "a", 100, 1.0, config="configs/clip_only_rotator.yaml", settings=["width=0.5"])
    write(tmp_path, "b", 100, 2.0, config="rn50_bert_rotator", own_encoders=False)
    assert [row[11] for row in rows_of(write_report(tmp_path)[1])] == ["CLIP-only", "CLIPORT (single)"]


def test_what_the_paper_has_not_stands_beside_nothing(tmp_path: Path) -> None:
    unseen, objects = TASK.replace("seen", "unseen"), "packing-seen-google-objects-seq"
    test = result("x", 100, 50.0)["test"][TASK]
    write(tmp_path, "told", 100, 9.0, task=TASK, settings=["train.recolor=surveyed"], test={TASK: test, unseen: test})
    write(tmp_path, "own", 100, 9.0, task=TASK, test={TASK: test, objects: test | {"object_set": "own-56"}})
    rows = {(row[1], row[0]): [row[5], row[9]] for row in rows_of(write_report(tmp_path)[1])}
    assert all(rows[method, TASK][0] and rows[method, TASK][1] for method in ("told", "own"))
    assert rows["told", unseen] == rows["own", objects] == ["", ""]


def test_each_network_has_a_line_beside_the_papers(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    drawn: list[Figure] = []
    monkeypatch.setattr(Figure, "savefig", lambda figure, path, dpi: drawn.append(figure))
    for method, n_demos, score in (("compact", 10, 55.5), ("transporter", 100, 22.25), ("compact", 100, 99.0)):
        write(tmp_path, method, n_demos, score)
    write_report(tmp_path)
    (panel,) = drawn[0].axes
    lines = {line.get_label(): (list(line.get_xdata()), list(line.get_ydata())) for line in panel.lines}
    paper = [paper_scores()["1", "CLIPORT (single)", TASK, n] for n in (1, 10, 100, 1000)]
    assert lines == {
        "compact": ([10, 100], [55.5, 99.0]),
        "transporter": ([100], [22.25]),
        "paper, test: CLIPORT (single)": ([1, 10, 100, 1000], paper),
        "chance": ([0, 1], [20.0, 20.0]),
    }
    assert panel.get_title() == TASK and panel.get_ylim() == (0, 103) and panel.get_xscale() == "log"


@pytest.mark.parametrize(
    ("error", "words"), [(OSError(28, "No space left on device"), "No space left on device"), (OSError("odd"), "odd")]
)
def test_a_report_that_cannot_be_written_is_one_line(tmp_path: Path, monkeypatch, error: OSError, words: str) -> None:
    def fails(*_: object) -> None:
        raise error

    write(tmp_path, "compact", 100, 50.0)
    monkeypatch.setattr("cliport_benchmark.experiment_report._plot", fails)
    with pytest.raises(DataFolderError, match=f"^cannot write the report in {tmp_path}: {words}$"):
        write_report(tmp_path)


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
    with pytest.raises(OptionError, match="--config image_goal_rotator reads an image of the goal"):
        Experiment(TASK, "image_goal_rotator", 10, steps=100, keep_steps=(100,))
