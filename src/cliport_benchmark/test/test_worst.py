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
from cliport_benchmark.confusions import Confusion, confused_colors, counts, judged
from cliport_benchmark.episode import Episode, Step

BOWLS, HANOI = "put-blocks-in-bowls-seen-colors", "towers-of-hanoi-seq-seen-colors"
STEP = Step(
    "put the red blocks in a green bowl", "pick_place", (0.4, -0.2, 0.0), (0.5, 0.3, 0.0),
    "red block", "green bowl", True, True, "SUCCEEDED", "", 0.1, 1.0,
)  # fmt: skip
PICKED_BLUE = replace(STEP, picked="blue block", pick_right=False, place_right=False)
BESIDE = replace(STEP, place_at="", place_right=False)
OTHER_THING = replace(STEP, picked="green bowl", pick_right=False, place_right=False)
OTHER_BOWL = replace(STEP, place_at="white bowl", place_right=False)
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


def test_what_was_chosen_is_told_apart_by_what_was_asked_for() -> None:
    of = list(judged([STEP, PICKED_BLUE, BESIDE, OTHER_THING, OTHER_BOWL, ANOTHER, UNNAMED]))
    assert counts(of, True) == {Confusion.NONE: 4, Confusion.COLOR: 1, Confusion.THING: 1}
    places = {Confusion.NONE: 1, Confusion.BESIDE: 1, Confusion.COLOR: 1, Confusion.ONE: 1}
    assert counts(of, False) == places, "of a wrong pick no place is asked for"
    found = judged([PICKED_BLUE, PICKED_BLUE, OTHER_BOWL, OTHER_THING, BESIDE, UNNAMED])
    assert confused_colors(found) == {("red block", "blue block"): 2, ("green bowl", "white bowl"): 1}


PACKED = replace(STEP, instruction="pack all the white and brown blocks into the brown box", place_at="brown box")
JUICE = replace(STEP, instruction="pack the orange juice box in the brown box", picked="tea box", place_at="brown box")


@pytest.mark.parametrize(
    ("step", "is_pick", "confusion", "colors"),
    [
        (
            replace(PACKED, picked="blue box", pick_right=False),
            True,
            Confusion.COLOR,
            ("white or brown box", "blue box"),
        ),
        (replace(PACKED, picked="brown box", pick_right=False), True, Confusion.THING, None),
        (replace(PACKED, picked="white box"), False, Confusion.NONE, None),
        (replace(PACKED, picked="white box", place_at="brown box", place_right=False), False, Confusion.ONE, None),
        (replace(JUICE, pick_right=False), True, Confusion.THING, None),
        (replace(JUICE, picked="brown box", pick_right=False), True, Confusion.THING, None),
    ],
)
def test_a_name_that_holds_a_colour_is_a_name(
    step: Step, is_pick: bool, confusion: Confusion, colors: tuple[str, str] | None
) -> None:
    of = [one for one in judged([step]) if one.is_pick is is_pick]
    assert [one.confusion for one in of] == [confusion]
    assert confused_colors(of) == ({colors: 1} if colors else {})


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
    assert f"| {BOWLS} | test | pick | 4 | 25.0 | 75.0 | 0.0 | 0.0 | 0.0 |" in table
    assert "## mine\n" in table and "## mine, randomized: light\n" in table
    assert "| red block | blue block | 3 |" in table


def test_where_nothing_fell_short_no_picture_is_left(tmp_path: Path, capsys) -> None:
    results, out = tmp_path / "results", tmp_path / "out"
    out.mkdir()
    (out / "worst.jpg").touch()
    write(results / "bowls.json", episode(3, 1.0, STEP))
    assert worst_cli.main([str(results), "--out", str(out)]) == 0
    assert capsys.readouterr().out.startswith("no episode that can be shown fell short of 1; what was confused in ")
    assert not (out / "worst.jpg").exists() and (out / "confusions.md").is_file()


def test_a_motion_that_failed_is_what_went_wrong() -> None:
    failed = replace(STEP, outcome="PLANNING_FAILED")
    assert worst_cli._words(episode(3, 0.5, STEP, failed)).startswith(
        "2: put the red blocks in a green bowl. red block to"
    )
    assert worst_cli._words(episode(3, 0.5, STEP, failed)).endswith(" green bowl, planning failed")
    assert worst_cli._words(episode(3, 0.5, STEP)).endswith("all right, in 1 steps")


def test_a_scene_is_drawn_with_its_actions_the_robots_side_up(tmp_path: Path) -> None:
    results, out = tmp_path / "results", tmp_path / "out"
    write(results / "bowls.json", episode(3, 0.25, STEP, PICKED_BLUE))
    assert worst_cli.main([str(results), "--out", str(out)]) == 0
    one = worst_cli.Evaluated("mine", BOWLS, "val", True, episode(3, 0.25, STEP, BESIDE))
    drawn, plain = (worst_cli._shown(e) for e in (one, one._replace(episode=episode(3, 0.25))))
    assert drawn.title == f"{BOWLS} val 3: 0.25" and plain.sentence.endswith("all right, in 0 steps")
    assert drawn.sentence == "2: put the red blocks in a green bowl. red block to nothing, succeeded"
    rows, cols = np.nonzero((drawn.picture != plain.picture).any(-1))
    assert drawn.picture.shape == (320, 640, 3)
    assert cols.min() < 170 and cols.max() > 540, "y runs to the right"
    assert rows.min() > 100 and rows.max() < 235, "x runs down, away from the robot"
    assert np.asarray(Image.open(out / "worst.jpg")).shape[0] > 320


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["{tmp}/none"], "there is no folder"),
        (["{tmp}"], "holds no results of evaluate"),
        (["{tmp}", "--count", "0"], "--count must be 1 or more, got 0"),
    ],
)
def test_bad_input_is_one_line(arguments: list[str], words: str, tmp_path: Path, capsys) -> None:
    given = [argument.format(tmp=tmp_path) for argument in arguments]
    assert worst_cli.main([*given, "--out", str(tmp_path / "out")]) == 1
    error = capsys.readouterr().err
    assert error.startswith("error: ") and words in error and error.count("\n") == 1
