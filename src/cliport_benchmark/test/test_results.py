"""The table of results: every split has its row, the paper's figures are the paper's, foreign files are left out."""

import csv
import hashlib
import json
from dataclasses import replace
from pathlib import Path

import pytest

from cliport_benchmark import card_scores
from cliport_benchmark.doubts import card_doubts
from cliport_benchmark.paper_scores import paper_methods, paper_row, paper_scores
from cliport_benchmark.results import main
from cliport_policy.card import load_card, resolve_checkpoint
from sim_bridge.tasks import DEMO_TASKS, LANGUAGE_SPLITS

COMMIT = "0123456789abcdef"
BOWLS = "put-blocks-in-bowls-unseen-colors"
OBJECTS = "packing-unseen-google-objects-seq"
HANOI = "towers-of-hanoi-seq-seen-colors"
UNCOUNTED = ("unknown", "unknown", "unknown", "", "")  # counts, chance and the blind agent of a result of old


def write(path: Path, **values: object) -> None:
    result = {
        "task": HANOI,
        "split": "test",
        "checkpoint": "expert",
        "mean_score": 98.57,
        "n_episodes": 50,
        "commit": COMMIT,
    }
    path.write_text(json.dumps(result | values))


def sections(text: str) -> dict[str, dict[str, list[str]]]:
    """The rows of each section by task, as lists of cells."""
    found: dict[str, dict[str, list[str]]] = {}
    for part in text.split("## ")[1:]:
        title, *lines = part.splitlines()
        rows = [[cell.strip() for cell in line.split("|")[1:-1]] for line in lines if line.startswith("| ")][2:]
        found[title] = {row[0]: row for row in rows}
    return found


def test_every_split_of_the_paper_has_its_figures() -> None:
    for table, tasks in (("1", LANGUAGE_SPLITS), ("4", LANGUAGE_SPLITS), ("6", DEMO_TASKS)):
        assert {task for t, _, task, _ in paper_scores() if t == table} == set(tasks)
    assert len(paper_scores()) == 680 + 392
    assert paper_scores()["4", "CLIPORT (single)", HANOI, 100] == 99.9


def test_the_papers_averages_come_out() -> None:
    """Table 1's own averages over the nine seen splits, CLIPort trained on single tasks."""
    seen = [task for task in LANGUAGE_SPLITS if "-seen-" in task or task in ("align-rope",)]
    assert len(seen) == 9
    means = [sum(paper_scores()["1", "CLIPORT (single)", task, n] for task in seen) / 9 for n in (1, 10, 100, 1000)]
    assert means == pytest.approx([35.2, 65.6, 85.8, 94.1], abs=0.06)


def test_table_5_holds_test_scores() -> None:
    """Networks that stand in tables 1 and 5 have the same scores, but for CLIP-only with everyday objects."""
    rows = [paper_row(name) for name in ("cliport", "transporter", "clip_only", "rn50_bert")]
    cells = [(row, task, n) for row in rows for t, m, task, n in paper_scores() if (t, m) == ("5", row.ablation)]
    same = [row.score("1", task, n) == row.score("5", task, n) for row, task, n in cells]
    assert len(cells) == 64 and same.count(False) == 8
    assert {(row.main, "google" in task) for (row, task, _), ok in zip(cells, same) if not ok} == {("CLIP-only", True)}


def test_a_networks_row_is_found_by_its_config() -> None:
    assert paper_row("transporter_rotator").main == paper_row("configs/transporter.yaml").main == "Transporter-only"
    assert paper_row("rn50_bert_rotator").main == "RN50-BERT"
    assert paper_row("rn50_bert_rotator", own_encoders=False) == paper_row("cliport") == paper_row("mine.yaml")
    for name in ("cliport", "transporter", "clip_only", "rn50_bert"):
        row = paper_row(name)
        assert row.main in paper_methods("1") and row.main in paper_methods("4") and row.ablation in paper_methods("5")


def test_test_scores_stand_beside_table_1_and_validation_scores_beside_table_4(tmp_path: Path) -> None:
    write(tmp_path / "a.json")
    (tmp_path / "more").mkdir()
    write(tmp_path / "more" / "b.json", split="val", mean_score=88.8)
    write(tmp_path / "c.json", task="sweeping-piles", mean_score=None, n_episodes=0)
    write(tmp_path / "d.json", task="sweeping-piles", split="val")
    write(tmp_path / "e.json", split="train", mean_score=77.7)
    out = tmp_path / "out" / "results.md"
    assert main([str(tmp_path), "--out", str(out), "--demos", "100"]) == 0
    found = sections(out.read_text())
    assert [title.split("(")[-1] for title in found] == [
        "paper: table 1)",
        "paper: table 4)",
        "the paper has no test scores of them)",
        "paper: table 6)",
        "Other tasks, training scenes and set-ups of one's own",
    ]
    test, val, demo_test, demo_val, other = found.values()
    assert set(test) == set(val) == set(LANGUAGE_SPLITS) and set(demo_val) == set(DEMO_TASKS)
    for rows, table, score in ((test, "1", "98.6"), (val, "4", "88.8")):
        paper = [paper_scores().get((table, method, HANOI, 100)) for method in paper_methods(table)]
        assert rows[HANOI] == [
            HANOI,
            "expert",
            rows[HANOI][2],
            score,
            "50",
            *UNCOUNTED,
            *("" if p is None else f"{p}" for p in paper),
        ]
    assert test[HANOI][10:] != val[HANOI][10:]
    assert demo_test == {"sweeping-piles": ["sweeping-piles", "expert", "test", "", "0", *UNCOUNTED]}
    assert len(demo_val["sweeping-piles"]) == 14
    assert other[HANOI] == [HANOI, "expert", "train", "77.7", "50", *UNCOUNTED]
    table = {row["split"]: row for row in csv.DictReader(out.with_suffix(".csv").open()) if row["task"] == HANOI}
    one, four = "table 1: CLIPORT (single) @1", "table 4: CLIPORT (single) @1"
    assert table["test"][one] and not table["test"][four] and table["val"][four] == "55.3" and not table["val"][one]
    assert not table["train"][one] and not table["train"][four]


def test_what_a_score_is_worth_stands_beside_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """How many scenes were not as drawn, chance, and the blind agent on the same scenes, else on the most."""
    mine, blind = tmp_path / "mine", tmp_path / "blind"
    mine.mkdir()
    blind.mkdir()
    counts = {"discarded": 0, "redrawn": 3, "broken": 1, "chance": 19.52}
    write(mine / "a.json", task=BOWLS, checkpoint="mine", first_seed=0, **counts)
    write(mine / "b.json", task=HANOI, checkpoint="mine", first_seed=0, discarded=2, redrawn=0, broken=0, chance=None)
    write(mine / "c.json", task=OBJECTS, checkpoint="mine", first_seed=0, object_set="own-56", n_episodes=20)
    write(mine / "d.json", task=BOWLS, split="val", checkpoint="mine", first_seed=0)
    blind_one = {"checkpoint": "blind", "without_arm": True}
    write(blind / "a.json", task=BOWLS, first_seed=0, mean_score=31.2, mean_score_with_next=40.06, **blind_one)
    write(blind / "more.json", task=BOWLS, first_seed=0, n_episodes=100, mean_score=32.1, **blind_one)
    write(blind / "other.json", task=HANOI, first_seed=0, n_episodes=40, mean_score=44.4, **blind_one)
    write(blind / "dark.json", task=HANOI, first_seed=0, mean_score=1.0, randomize={"light": {}}, **blind_one)
    write(blind / "own.json", task=OBJECTS, first_seed=0, mean_score=41.2, object_set="own-56", **blind_one)
    write(blind / "google.json", task=OBJECTS, first_seed=0, mean_score=2.0, object_set="google folder", **blind_one)
    assert main([str(mine), str(blind), "--out", str(tmp_path / "r.md")]) == 0
    lines = (tmp_path / "r.md").read_text().splitlines()
    rows = [[cell.strip() for cell in line.split("|")[1:-1]] for line in lines if line.startswith("| ")]
    beside = {(row[0], row[2]): row[5:10] for row in rows if row[1].startswith("mine")}
    assert beside == {
        (BOWLS, "test"): ["0", "3", "1", "19.5", "31.2"],
        (HANOI, "test"): ["2", "0", "0", "", "44.4 (40)"],
        (OBJECTS, "test"): ["unknown", "unknown", "unknown", "", "41.2 (50)"],
        (BOWLS, "val"): ["unknown", "unknown", "unknown", "", ""],
    }
    assert any("blind, without the arm" in line for line in lines)
    assert [row[2:] for row in rows if row[3:5] == ["40.1", "31.2"]] == [["50", "40.1", "31.2", "0123456"]]
    table = csv.DictReader((tmp_path / "r.csv").open())
    assert {row["redrawn"] for row in table if row["by"] == "mine"} == {"3", "0", "unknown"}
    assert main([str(mine), str(tmp_path / "none")]) == 1
    assert "there is no folder" in capsys.readouterr().err


def test_what_has_no_counterpart_stands_beside_nothing(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Everyday objects of one's own, and unseen colours of a policy that had met their words."""
    write(tmp_path / "own.json", task=OBJECTS, object_set="own-56")
    write(tmp_path / "google.json", task=OBJECTS, object_set="google OBJ folder, 56 of 56", mean_score=50.0)
    write(tmp_path / "told.json", task=BOWLS, met_surveyed_colors=True, method="compact", mean_score=60.0)
    write(tmp_path / "seen.json", task=BOWLS.replace("unseen", "seen"), met_surveyed_colors=True, mean_score=99.0)
    assert main([str(tmp_path)]) == 0
    found = sections(capsys.readouterr().out)
    test = next(rows for title, rows in found.items() if "table 1" in title)
    assert test[OBJECTS][1:4] == ["expert, google OBJ folder, 56 of 56", "test", "50.0"] and len(test[OBJECTS]) == 16
    assert test[BOWLS][1] == "" and test[BOWLS.replace("unseen", "seen")][3] == "99.0"
    own = next(rows for title, rows in found.items() if "of this project's own" in title)
    assert own == {OBJECTS: [OBJECTS, "expert, own-56", "test", "98.6", "50", *UNCOUNTED]}
    told = next(rows for title, rows in found.items() if "surveyed" in title)
    assert told == {BOWLS: [BOWLS, "expert (compact)", "test", "60.0", "50", *UNCOUNTED]}


def test_doubtful_scores_are_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    weights = tmp_path / "w" / "policy.safetensors"
    weights.parent.mkdir()
    weights.write_bytes(b"new weights")
    card = load_card(resolve_checkpoint("default"))
    sha = hashlib.sha256(b"new weights").hexdigest()
    good = {"mean_score": 1.0, "commit": COMMIT, "dirty": False, "weights_sha256": sha}
    scores = {
        "good": good,
        "other": good | {"weights_sha256": "0" * 64},
        "dirty": good | {"dirty": True},
        "calibration": {"pick": {}},
    }
    weights.with_suffix(".json").write_text(json.dumps(replace(card, scores=scores).to_dict()))
    result = {"checkpoint": str(weights), "dirty": False, "commit": COMMIT}
    results = tmp_path / "results"
    results.mkdir()
    write(results / "a.json", **result, weights_sha256="1" * 64)
    assert main([str(results)]) == 0
    said = [line for line in capsys.readouterr().out.splitlines() if line.startswith("- ")]
    assert [line.split(": ", 1)[1] for line in said] == [
        f"{HANOI} test was scored on other weights than those that are there now",
        "the card's 'other' was scored on other weights than the card's",
        "the card's 'dirty' was measured on changes to commit 0123456",
    ]
    write(results / "a.json", checkpoint="expert", commit=f"{COMMIT}+changes")
    assert main([str(results)]) == 0
    assert f"- expert: {HANOI} test was measured on changes to commit 0123456" in capsys.readouterr().out


def test_the_card_takes_scores_of_its_own_weights_only(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    weights = tmp_path / "policy.safetensors"
    weights.write_bytes(b"weights")
    card = load_card(resolve_checkpoint("default"))
    stale = {"bowls test": {"mean_score": 9.0}, "x test": {"mean_score": 9.0, "weights_sha256": "0" * 64}}
    kept = {"calibration": {"pick": {"n": 3}}}
    weights.with_suffix(".json").write_text(json.dumps(replace(card, scores=stale | kept).to_dict()))
    write(
        tmp_path / "a.json", chance=19.5, redrawn=2, dirty=False, weights_sha256=hashlib.sha256(b"weights").hexdigest()
    )
    assert card_scores.main(["--checkpoint", str(weights), str(tmp_path / "a.json")]) == 0
    assert list(load_card(weights).scores) == ["calibration", f"{HANOI} test"]
    entry = next(item for item in load_card(weights).scores.items() if item[0] != "calibration")
    assert entry[1]["redrawn"] == 2
    assert entry[0] == f"{HANOI} test" and entry[1]["mean_score"] == 98.57 and entry[1]["commit"] == COMMIT
    assert entry[1]["dirty"] is False and card_doubts(weights) == []
    write(tmp_path / "b.json", dirty=False, weights_sha256="0" * 64)
    write(tmp_path / "c.json")
    for name, words in (("b", "is of other weights (000000000000, not"), ("c", "does not say weights_sha256, dirty")):
        assert card_scores.main(["--checkpoint", str(weights), str(tmp_path / f"{name}.json")]) == 1
        error = capsys.readouterr().err
        assert words in error and error.count("\n") == 1
    assert len(load_card(weights).scores) == 2


def test_the_card_tells_scores_of_different_conditions_apart(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    weights = tmp_path / "policy.safetensors"
    weights.write_bytes(b"weights")
    card = load_card(resolve_checkpoint("default"))
    weights.with_suffix(".json").write_text(json.dumps(replace(card, scores={}).to_dict()))
    common = {"dirty": False, "weights_sha256": hashlib.sha256(b"weights").hexdigest()}
    conditions: dict[str, dict[str, object]] = {
        "": {"offset": "centred"},
        ", exact offset": {"offset": "exact"},
        ", through the graph": {"graph": True, "offset": "centred"},
        ", randomized: light": {"randomize": {"light": {}}},
        ", own set-up": {"camera": {"width": 1}},
    }
    paths = [tmp_path / f"{number}.json" for number in range(len(conditions))]
    for path, values in zip(paths, conditions.values(), strict=True):
        write(path, **common, **values)
    command = ["--checkpoint", str(weights), *map(str, paths)]
    assert card_scores.main(command) == 0
    scores = load_card(weights).scores
    assert list(scores) == [f"{HANOI} test{words}" for words in conditions]
    assert scores[f"{HANOI} test, exact offset"]["offset"] == "exact"
    write(tmp_path / "again.json", **common, mean_score=1.0)
    assert card_scores.main([*command, str(tmp_path / "again.json")]) == 1
    assert f"again.json is a second score of '{HANOI} test'" in capsys.readouterr().err


def test_other_tasks_have_a_section_of_their_own(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write(tmp_path / "a.json")
    assert main([str(tmp_path)]) == 0
    assert "Other tasks" not in capsys.readouterr().out
    write(tmp_path / "b.json", task="towers-of-hanoi-seq-full", mean_score=12.34)
    assert main([str(tmp_path), "--out", str(tmp_path / "results.md")]) == 0
    before, _, others = (tmp_path / "results.md").read_text().partition("## Other tasks")
    assert "| towers-of-hanoi-seq-full | expert | test | 12.3 | 50 |" in others and HANOI not in others
    assert "towers-of-hanoi-seq-full" not in before
    table = list(csv.DictReader((tmp_path / "results.csv").open()))
    assert len(table) == 19 and table[-1]["task"] == "towers-of-hanoi-seq-full"
    assert [row["task"] for row in table[:-1]] == list(LANGUAGE_SPLITS)  # also those that were not evaluated


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


def test_scores_of_other_looks_stand_beside_nothing(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write(tmp_path / "plain.json")
    write(tmp_path / "varied.json", randomize={"light": {}})
    write(tmp_path / "exact.json", task=BOWLS, offset="exact")
    assert main([str(tmp_path)]) == 0
    found = sections(capsys.readouterr().out)
    (other,) = [rows for title, rows in found.items() if title.startswith("Other tasks")]
    assert "randomized: light" in other[HANOI][1] and len(other) == 1
    (beside,) = [rows for title, rows in found.items() if "paper: table 1" in title]
    assert "randomized" not in str(beside[HANOI]) and beside[BOWLS][1] == "expert, exact offset"


@pytest.mark.parametrize("demos", ["7", "10,7", "", ",", "ten"])
def test_demonstrations_that_the_paper_lacks_are_refused(
    demos: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["--demos", demos, str(tmp_path)]) == 1
    assert capsys.readouterr().err.startswith("error: --demos must be ")
