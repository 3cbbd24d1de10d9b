"""The table of results: every split has its row, the paper's figures are the paper's, foreign files are left out."""

import csv
import json
from pathlib import Path

import pytest

from cliport_benchmark.results import main, paper_scores
from sim_bridge.tasks import DEMO_TASKS, LANGUAGE_SPLITS

HANOI = "towers-of-hanoi-seq-seen-colors"


def write(path: Path, **values: object) -> None:
    result = {"task": HANOI, "split": "test", "checkpoint": "expert", "mean_score": 98.57, "n_episodes": 50}
    path.write_text(json.dumps(result | values))


def test_every_split_of_the_paper_has_its_figures() -> None:
    for table, tasks in (("4", LANGUAGE_SPLITS), ("6", DEMO_TASKS)):
        assert {task for t, _, task, _ in paper_scores() if t == table} == set(tasks)
    assert len(paper_scores()) == 680
    assert paper_scores()["4", "CLIPORT (single)", HANOI, 100] == 99.9


def test_evaluations_stand_beside_the_paper(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write(tmp_path / "a.json")
    (tmp_path / "more").mkdir()
    write(tmp_path / "more" / "b.json", task="put-block-in-bowl-seen-colors", checkpoint="default", n_episodes=100)
    write(tmp_path / "c.json", task="sweeping-piles", mean_score=None, n_episodes=0)
    out = tmp_path / "out" / "results.md"
    assert main([str(tmp_path), "--out", str(out), "--demos", "100"]) == 0
    lines = out.read_text().splitlines()
    rows = {tuple(cell.strip() for cell in line.split("|")[1:6]) for line in lines if line.startswith("| ")}
    assert (HANOI, "expert", "test", "98.6", "50") in rows
    assert ("put-blocks-in-bowls-seen-colors", "default", "test", "98.6", "100") in rows
    assert ("sweeping-piles", "expert", "test", "", "0") in rows
    assert {row[0] for row in rows} >= {*LANGUAGE_SPLITS, *DEMO_TASKS}
    (hanoi,) = [line for line in lines if line.startswith(f"| {HANOI} ")]
    assert "| 99.9 |" in hanoi
    table = list(csv.DictReader((tmp_path / "out" / "results.csv").open()))
    assert len(table) == 28
    (row,) = [row for row in table if row["task"] == HANOI]
    assert row["score"] == "98.6" and row["table 4: CLIPORT (single) @1"] == "55.3"
    assert main([str(tmp_path)]) == 0
    assert "CLIPORT (multi-attr) @1000" in capsys.readouterr().out


def test_what_is_no_evaluation_is_one_line_each(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([str(tmp_path / "none")]) == 1
    assert capsys.readouterr().err == (
        f"error: there is no folder {tmp_path}/none: name the one that evaluate wrote to\n"
    )
    (tmp_path / "cut.json").write_text('{"task": "tow')
    (tmp_path / "list.json").write_text("[1, 2]")
    (tmp_path / "bench.json").write_text('{"rows": []}')
    write(tmp_path / "odd.json", mean_score="high")
    write(tmp_path / "unknown.json", task="juggling")
    assert main([str(tmp_path)]) == 1
    error = capsys.readouterr().err.splitlines()
    assert len(error) == 6 and sum(line.startswith("left out: ") for line in error) == 5
    assert "holds no results of evaluate" in error[-1]
