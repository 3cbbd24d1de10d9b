"""The worst episodes' pictures, and what was confused with what."""

from __future__ import annotations

import json
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from cliport_benchmark import worst_cli
from cliport_benchmark.confusions import Choice, choices_of, color_confusions, kind_of
from cliport_benchmark.episode import Episode, Step

BOWLS, HANOI = "put-blocks-in-bowls-seen-colors", "towers-of-hanoi-seq-seen-colors"
STEP = Step(
    "put the red blocks in a green bowl", "pick_place", (0.4, -0.2, 0.0), (0.5, 0.3, 0.0),
    "red block", "green bowl", True, True, "SUCCEEDED", "", 0.1, 1.0,
)  # fmt: skip
PICKED_BLUE = replace(STEP, picked="blue block", pick_right=False)
BESIDE = replace(STEP, place_at="", place_right=False)
OTHER_THING = replace(STEP, picked="green bowl", pick_right=False, place_at="white bowl", place_right=False)
ANOTHER = replace(STEP, place_at="green bowl", place_right=False)
UNNAMED = replace(PICKED_BLUE, instruction="juggle")


def episode(seed: int, score: float, *steps: Step) -> Episode:
    return Episode(seed, score, len(steps), 3, 0, STEP.instruction, None, 1.0, "", steps)


def write(path: Path, *episodes: Episode, **values: Any) -> None:
    found = {
        "task": BOWLS, "split": "test", "checkpoint": "mine", "mean_score": 50.0, "n_episodes": len(episodes),
        "first_seed": 0, "episodes": [asdict(one) for one in episodes], **values,
    }  # fmt: skip
    path.parent.mkdir(exist_ok=True)
    path.write_text(json.dumps(found))


def test_choices_are_told_apart_by_what_was_asked_for() -> None:
    picks, places = choices_of([STEP, PICKED_BLUE, BESIDE, OTHER_THING, ANOTHER, UNNAMED])
    assert picks == {Choice.RIGHT: 3, Choice.COLOR: 1, Choice.THING: 1}
    assert places == {Choice.RIGHT: 2, Choice.NOTHING: 1, Choice.COLOR: 1, Choice.ONE: 1}
    assert color_confusions([PICKED_BLUE, PICKED_BLUE, OTHER_THING, BESIDE, UNNAMED]) == {
        ("red block", "blue block"): 2,
        ("green bowl", "white bowl"): 1,
    }
    assert [kind_of(words) for words in ("red letter A shape", "tea box", "bead")] == [
        ("red", "letter A shape"), (None, "tea box"), (None, "bead"),
    ]  # fmt: skip


def test_any_of_several_colours_may_have_been_asked_for() -> None:
    step = replace(STEP, instruction="pack all the white and pink blocks into the brown box", picked="blue box")
    step = replace(step, pick_right=False)
    assert color_confusions([step]) == {("white or pink box", "blue box"): 1}


def test_the_worst_of_each_task_in_its_turn_is_shown(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys) -> None:
    shown: list[tuple[str, int]] = []

    def picture(one: worst_cli.Evaluated) -> worst_cli.Captioned:
        shown.append((one.task, one.episode.seed))
        return worst_cli.Captioned("title", np.zeros((20, 40, 3), np.uint8), "words")

    monkeypatch.setattr(worst_cli, "_shown", picture)
    results, out = tmp_path / "results", tmp_path / "a" / "out"
    write(
        results / "bowls.json", *(episode(seed, 0.1 * seed, PICKED_BLUE) for seed in (3, 2, 1)), episode(9, 1.0, STEP)
    )
    write(results / "hanoi.json", episode(5, 0.5, BESIDE), task=HANOI)
    write(results / "dark.json", episode(7, 0.0, BESIDE), randomize={"light": {}})
    (results / "list.json").write_text("[]")
    assert worst_cli.main([str(results), "--count", "3", "--out", str(out)]) == 0
    assert shown == [(BOWLS, 1), (HANOI, 5), (BOWLS, 2)]
    said = capsys.readouterr()
    assert said.err.startswith("left out: ") and said.out.startswith("3 of 6 episodes in ")
    assert (out / "worst.jpg").is_file()
    table = (out / "confusions.md").read_text()
    assert f"| {BOWLS} | 5 | pick | 40.0 | 60.0 | 0.0 | 0.0 | 0.0 |" in table
    assert "| red block | blue block | 3 |" in table


def test_a_scene_is_drawn_with_its_actions_the_robots_side_up(tmp_path: Path) -> None:
    results, out = tmp_path / "results", tmp_path / "out"
    write(results / "bowls.json", episode(3, 0.25, STEP, PICKED_BLUE))
    assert worst_cli.main([str(results), "--out", str(out)]) == 0
    one = worst_cli.Evaluated(BOWLS, "test", True, episode(3, 0.25, STEP, BESIDE))
    drawn, plain = (worst_cli._shown(e) for e in (one, one._replace(episode=episode(3, 0.25))))
    assert drawn.title == f"{BOWLS} 3: 0.25" and plain.sentence.endswith("all right, in 0 steps")
    assert drawn.sentence == "2: put the red blocks in a green bowl. red block to nothing, succeeded"
    rows, cols = np.nonzero((drawn.picture != plain.picture).any(-1))
    assert drawn.picture.shape == (320, 640, 3)
    assert cols.min() < 170 and cols.max() > 540, "y runs to the right"
    assert rows.min() > 100 and rows.max() < 235, "x runs down, away from the robot"
    assert np.asarray(Image.open(out / "worst.jpg")).shape[0] > 320


@pytest.mark.parametrize(
    ("arguments", "words"),
    [(["{tmp}/none"], "there is no folder"), (["{tmp}"], "holds no results of evaluate")],
)
def test_bad_input_is_one_line(arguments: list[str], words: str, tmp_path: Path, capsys) -> None:
    given = [argument.format(tmp=tmp_path) for argument in arguments]
    assert worst_cli.main([*given, "--out", str(tmp_path / "out")]) == 1
    error = capsys.readouterr().err
    assert error.startswith("error: ") and words in error and error.count("\n") == 1


@pytest.mark.parametrize("count", ["0", "-1", "many"])
def test_a_count_is_a_whole_number(count: str, tmp_path: Path, capsys) -> None:
    with pytest.raises(SystemExit):
        worst_cli.main([str(tmp_path), "--count", count])
    assert "give a whole number from 1 on" in capsys.readouterr().err
