"""Results over errors of the camera's mounting: what is read, what is refused, and that there is a picture."""

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cliport_benchmark.mounting_curve import MountingScore, draw_curve, main, read_mounting_scores


def write(path: Path, scores: list[float], mm: float | None = None, degrees: float = 0.0, **changes: Any) -> None:
    varied = False if mm is None else {"mounting": {"shift": mm / 1000.0, "turn": math.radians(degrees)}}
    values = {
        "checkpoint": "default", "task": "put-blocks-in-bowls-seen-colors", "split": "test", "first_seed": 0,
        "n_episodes": len(scores), "randomize": varied, "episodes": [{"score": score} for score in scores],
    }  # fmt: skip
    path.write_text(json.dumps(values | changes))


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    write(tmp_path / "none.json", [1.0, 1.0, 1.0])
    write(tmp_path / "shifted.json", [1.0, 0.5, 0.0], mm=10.0)
    write(tmp_path / "turned.json", [0.0, 0.0, 1.0], mm=0.0, degrees=2.0)
    return tmp_path


def test_scores_are_read_with_their_errors_and_intervals(folder: Path) -> None:
    none, turned, shifted = read_mounting_scores(folder)
    assert none == MountingScore("default", 0.0, 0.0, 100.0, 0.0, 3)
    assert (shifted.shift, shifted.turn, shifted.score) == (10.0, 0.0, pytest.approx(50.0))
    assert shifted.half_width == pytest.approx(1.96 * 50.0 / math.sqrt(3))
    assert (turned.shift, turned.turn, turned.score) == (0.0, 2.0, pytest.approx(100.0 / 3))


def test_the_picture_is_written_and_the_figures_said(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = folder / "new" / "curve.png"
    assert main([str(folder), "--out", str(out)]) == 0
    assert out.read_bytes().startswith(b"\x89PNG")
    assert "default, 10 mm, 0 degrees: 50.0 ± 56.6 (3 episodes)" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("changes", "word"),
    [
        ({"task": "stack-block-pyramid-seq-seen-colors"}, "are of other scenes"),
        ({"first_seed": 5}, "are of other scenes"),
        ({"randomize": {"light": {}, "mounting": {"shift": 0.0, "turn": 0.0}}}, "varied light, too"),
        ({"episodes": []}, "is no result of evaluate"),
        ({"episodes": [{}]}, "is no result of evaluate"),
    ],
)
def test_what_does_not_belong_together_is_refused(
    folder: Path, changes: dict[str, Any], word: str, capsys: pytest.CaptureFixture[str]
) -> None:
    write(folder / "other.json", [1.0, 1.0, 1.0], **changes)
    assert main([str(folder), "--out", str(folder / "curve.png")]) == 1
    assert word in capsys.readouterr().err
    assert not (folder / "curve.png").exists()


def test_nothing_to_draw_is_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([str(tmp_path / "absent"), "--out", str(tmp_path / "a.png")]) == 1
    assert "holds no results: run evaluate --randomize mounting" in capsys.readouterr().err
    write(tmp_path / "one.json", [1.0], mm=5.0, degrees=1.0)
    assert main([str(tmp_path), "--out", str(tmp_path / "a.png")]) == 1
    assert "nothing to draw" in capsys.readouterr().err
    assert main([str(tmp_path), "--out", str(tmp_path / "a.txt")]) == 1
    assert "must end in .png or .svg" in capsys.readouterr().err


def test_each_panel_has_its_error_and_nothing_else(folder: Path) -> None:
    write(folder / "both.json", [0.0, 0.0, 0.0], mm=10.0, degrees=2.0)
    shifts, turns = draw_curve(read_mounting_scores(folder)).axes
    assert (shifts.get_xlabel(), turns.get_xlabel()) == (
        "shift of the camera, σ per axis [mm]", "turn of the camera, σ per axis [degrees]",
    )  # fmt: skip
    assert shifts.lines[0].get_xydata() == pytest.approx(np.array([[0.0, 100.0], [10.0, 50.0]]))
    assert turns.lines[0].get_xydata() == pytest.approx(np.array([[0.0, 100.0], [2.0, 100.0 / 3]]))


def test_a_line_of_shifts_alone_is_enough() -> None:
    scores = [MountingScore("default", shift, 0.0, 90.0 - shift, 1.0, 10) for shift in (5.0, 10.0)]
    shifts, _ = draw_curve(scores).axes
    assert len(shifts.lines[0].get_xydata()) == 2
