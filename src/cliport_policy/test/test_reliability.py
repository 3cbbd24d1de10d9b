"""How far doubts can be trusted: shares by hand, and the command on a small set."""

import json
import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cliport_policy.data.demonstrations import load_demonstrations
from cliport_policy.policy import load_policy
from cliport_policy.reliability import Reliability, main, measure, table, table_of_sets

pytestmark = pytest.mark.usefixtures("one_thread")


def test_shares_by_hand() -> None:
    found = Reliability(
        finished=np.array([0.2, 0.6, 0.8, 0.95]),
        unfinished=np.array([0.05, 0.4]),
        confidence=np.array([0.2, 0.4, 0.6, 0.8]),
        right=np.array([False, True, False, True]),
    )
    assert found.done_right(0.5) == (0.75, 1.0)
    assert found.done_right(0.3) == (0.75, 0.5)
    assert found.acted(0.0) == (1.0, 0.5)
    assert found.acted(0.5) == (0.5, 0.5)
    assert found.acted(0.7) == (0.25, 1.0)
    assert math.isnan(found.acted(0.9)[1])
    assert len(found.foreign) == 0 and "not here" not in table(found)
    assert found.to_dict()["acted"]["0.9"] == [0.0, None]  # type: ignore[index]
    assert "none" in table(found).splitlines()[-1]


def test_what_is_not_there_is_counted_beside_false_alarms() -> None:
    nothing, foreign, own = np.zeros(1), np.array([0.9, 0.4, 0.6, 0.8]), np.array([0.1, 0.6])
    found = Reliability(nothing, nothing, nothing, np.array([True]), 0, foreign, own)
    assert found.absent_right(0.5) == (0.75, 0.5) and found.absent_right(0.7) == (0.5, 1.0)
    assert found.to_dict()["absent"]["0.5"] == [0.75, 0.5]  # type: ignore[index]
    assert "own not called so" in table(found)


def test_the_command(
    tiny_checkpoint: Callable[..., Path], make_flat_set: Callable[..., Path], tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    path, data = tiny_checkpoint("compact"), make_flat_set(tmp_path / "data", 3, actions=2, pixel_size=0.0125)
    out = tmp_path / "new" / "picture.png"
    arguments = ["--checkpoint", str(path), "--data", str(data), "--out", str(out)]
    assert main(arguments) == 0
    written = json.loads(out.with_suffix(".json").read_text())
    assert written["unfinished"] == 3 and set(written["done"]) == set(map(str, (0.1, 0.3, 0.5, 0.7, 0.9)))
    assert out.read_bytes().startswith(b"\x89PNG")
    assert "of these right" in capsys.readouterr().out
    assert main([*arguments, "--count", "0"]) == 1
    assert capsys.readouterr().err == "error: --count is 0: give at least 1\n"
    for name in ("r.txt", "r.json", "r"):
        assert main([*arguments[:4], "--out", str(tmp_path / name)]) == 1
        assert "give a picture's name, with .png, .pdf, .svg" in capsys.readouterr().err
        assert not (tmp_path / name).exists()


def test_several_sets_are_counted_together_and_each_alone(
    tiny_checkpoint: Callable[..., Path], make_flat_set: Callable[..., Path], tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    path, out = tiny_checkpoint("compact"), tmp_path / "picture.png"
    two = make_flat_set(tmp_path / "two", 2, actions=2, pixel_size=0.0125)
    three = make_flat_set(tmp_path / "three", 3, actions=1, pixel_size=0.0125)
    arguments = ["--checkpoint", str(path), "--out", str(out)]
    alone = []
    for folder in (two, three):
        assert main([*arguments, "--data", str(folder)]) == 0
        assert "from 0.5 on" not in capsys.readouterr().out
        alone.append(json.loads(out.with_suffix(".json").read_text()))
    assert main([*arguments, "--data", str(two), "--data", str(three)]) == 0
    written = json.loads(out.with_suffix(".json").read_text())
    assert (written["unfinished"], written["finished"]) == (5, 5)
    assert written["sets"] == [one["sets"][0] for one in alone]
    both = [(2 * a + 3 * b) / 5 for a, b in zip(*(one["done"]["0.1"] for one in alone), strict=True)]
    assert written["done"]["0.1"] == pytest.approx(both)
    shown = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in shown[-3:-1]] == [str(two), str(three)]


def test_answers_of_several_sets_are_those_of_one() -> None:
    def part(*numbers: float, refused: int) -> Reliability:
        values = [np.array([number]) for number in numbers]
        return Reliability(*values[:3], np.array([True]), refused, *values[3:])

    found = Reliability.joined([part(0.1, 0.2, 0.3, 0.4, 0.5, refused=1), part(0.6, 0.7, 0.8, 0.9, 1.0, refused=2)])
    assert (found.finished.tolist(), found.unfinished.tolist(), found.confidence.tolist()) == (
        [0.1, 0.6], [0.2, 0.7], [0.3, 0.8]
    )  # fmt: skip
    assert (found.foreign.tolist(), found.own.tolist(), found.refused) == ([0.4, 0.9], [0.5, 1.0], 3)
    assert found.right.dtype == bool and len(found.right) == 2
    lines = [line.split() for line in table_of_sets({"mine": part(0.1, 0.2, 0.6, 0.9, 0.3, refused=0)}).splitlines()]
    assert lines[1] == ["mine", "0.0", "%", *(["100.0", "%"] * 5)]


def test_a_policy_that_acts_on_an_image_of_the_goal_is_not_asked_for_what_is_not_there(
    tiny_checkpoint: Callable[..., Path], make_flat_set: Callable[..., Path], tmp_path: Path
) -> None:
    data = load_demonstrations(make_flat_set(tmp_path / "data", 2, actions=2, pixel_size=0.0125))
    listed = [replace(frame, things=(("", "stand"), ("green", "block"))) for frame in data.frames]
    found = measure(load_policy(tiny_checkpoint("image_goal")), replace(data, frames=listed), 2)
    assert len(found.unfinished) == 2 and len(found.foreign) == len(found.own) == 0


def test_data_of_another_workspace_are_refused(
    tiny_checkpoint: Callable[..., Path], make_flat_set: Callable[..., Path], tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    path, data = tiny_checkpoint("compact"), make_flat_set(tmp_path / "data", 1, actions=1, pixel_size=0.025)
    assert main(["--checkpoint", str(path), "--data", str(data), "--out", str(tmp_path / "p.png")]) == 1
    assert "give data of the workspace that it was trained in" in capsys.readouterr().err
    assert not (tmp_path / "p.png").exists()


def test_sentences_that_the_policy_refuses_are_counted(
    tiny_checkpoint: Callable[..., Path], make_flat_set: Callable[..., Path], tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    path, data = tiny_checkpoint("compact"), make_flat_set(tmp_path / "data", 2, actions=1, pixel_size=0.0125)
    odd = make_flat_set(
        tmp_path / "odd", 1, actions=1, pixel_size=0.0125, task="odd", sentence="qwertz uiop asdf", finish=False
    )
    arguments = ["--checkpoint", str(path), "--out", str(tmp_path / "picture.png")]
    assert main([*arguments, "--data", str(odd)]) == 1
    error = capsys.readouterr().err.splitlines()[-1]
    assert error.startswith(f"error: the policy refuses every sentence of {odd}") and "'qwertz uiop asdf'" in error
    (odd / "part-00000.parquet").rename(data / "part-00001.parquet")
    assert main([*arguments, "--data", str(data)]) == 0
    assert "2 finished and 2 unfinished scenes\n1 more refused for their sentence\n" in capsys.readouterr().out
    written = json.loads((tmp_path / "picture.json").read_text())
    assert (written["finished"], written["unfinished"], written["refused"]) == (2, 2, 1)
