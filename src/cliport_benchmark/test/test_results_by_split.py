"""Results by split: a column for each agent, averages of whole sets, and what is to be said of scenes in brackets."""

from pathlib import Path

import pytest
from test_results import BOWLS, HANOI, OBJECTS, sections, write

from cliport_benchmark.paper_scores import paper_methods
from cliport_benchmark.results import main
from sim_bridge.tasks import DEMO_TASKS, LANGUAGE_SPLITS


def test_by_split_says_how_many_scenes_where_the_numbers_differ(tmp_path: Path) -> None:
    write(tmp_path / "a.json", task=HANOI, checkpoint="mine", mean_score=80.0, first_seed=0, n_episodes=5)
    write(tmp_path / "b.json", task=BOWLS, checkpoint="mine", mean_score=70.0, first_seed=0, commit="abcdefghi")
    assert main([str(tmp_path), "--by-split", "--out", str(tmp_path / "r.md")]) == 0
    text = (tmp_path / "r.md").read_text()
    assert "| split | mine, seeds from 0 on (how many), 0123456, abcdefg |" in text
    (table,) = sections(text).values()
    assert (table[HANOI][1], table[BOWLS][1]) == ("80.0 (5, redraws not counted)", "70.0 (50, redraws not counted)")


def test_a_checkpoint_below_this_folder_is_called_as_it_is_from_here(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    write(tmp_path / "a.json", task=HANOI, checkpoint=str(tmp_path / "runs" / "mine"), first_seed=0)
    write(tmp_path / "b.json", task=HANOI, checkpoint="/elsewhere/runs/mine", first_seed=0)
    assert main([".", "--by-split", "--out", "r.md"]) == 0
    head = "| split | /elsewhere/runs/mine, seeds 0 to 49, 0123456 | runs/mine, seeds 0 to 49, 0123456 |"
    assert head in (tmp_path / "r.md").read_text()


def test_by_split_has_a_column_for_each_agent_and_averages_of_whole_sets(tmp_path: Path) -> None:
    seen = [t for t in LANGUAGE_SPLITS if "unseen" not in t and "google" not in t]
    for number, task in enumerate(seen):
        write(tmp_path / f"{number}.json", task=task, checkpoint="mine", mean_score=10.0 * number, first_seed=100)
    write(tmp_path / "blind.json", task=seen[0], checkpoint="blind", mean_score=3.0, first_seed=100)
    counts = {"discarded": 0, "redrawn": 2, "broken": 0, "chance": 19.5}
    write(tmp_path / "again.json", task=seen[0], checkpoint="mine", mean_score=55.0, first_seed=0, **counts)
    write(tmp_path / "own.json", task=OBJECTS, checkpoint="mine", mean_score=70.0, object_set="own objects")
    write(tmp_path / "survey.json", survey_colors=30.0)
    write(tmp_path / "demo.json", task=DEMO_TASKS[0])
    assert main([str(tmp_path), "--by-split", "--demos", "100,10", "--out", str(tmp_path / "r.md")]) == 0
    text = (tmp_path / "r.md").read_text()
    header = next(line for line in text.splitlines() if line.startswith("| split"))
    names = [cell.strip() for cell in header.split("|")[1:-1]]
    mine, blind = (f"{name}, seeds 100 to 149, 0123456" for name in ("mine", "blind"))
    assert names[1:4] == ["mine, seeds 0 to 49, 0123456", mine, f"language-blind, manually perfect ({blind})"]
    methods = paper_methods("1")
    assert names[4:] == ["chance", *(f"{method} @{count}" for count in (100, 10) for method in methods)]
    table, own = sections(text).values()
    unknown = "(redraws not counted)"
    assert table[seen[0]][1:5] == ["55.0 (2 redrawn)", f"0.0 {unknown}", f"3.0 {unknown}", "19.5"]
    assert table[seen[1]][1:5] == ["", f"10.0 {unknown}", "", ""]
    seen_average, unseen_average = (
        table[f"average, 7 {kind} splits without everyday objects"] for kind in ("seen", "unseen")
    )
    assert seen_average[1:5] == ["", "30.0", "", ""] and not any(unseen_average[1:5])
    column = names.index("CLIPORT (multi) @100")
    assert float(seen_average[column]) == pytest.approx(86.9, abs=0.06)
    assert float(unseen_average[column]) == pytest.approx(53.0, abs=0.06)
    assert own[OBJECTS][1] == f"70.0 {unknown}" and seen[0] not in own
    assert text.count("Mean scores, 0 to 100") == 1
    assert text.startswith(f"# Results\n\nWritten by `ros2 run cliport_benchmark results {tmp_path} --by-split")
    remark = text[text.index("Mean scores, 0 to 100") :].splitlines()
    assert max(map(len, remark)) <= 140 and "centred on the thing seen" in " ".join(remark)
    assert "\n\n2 of other tasks, scenes or looks are not shown here: leave --by-split out" in text
