"""The demo's animated GIF."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from cliport_benchmark import animation


class Clock:
    """Time that a test lets pass."""

    def __init__(self) -> None:
        self.now = 100.0

    def monotonic(self) -> float:
        return self.now


def test_an_animation_keeps_a_frame_every_so_often(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    clock = Clock()
    monkeypatch.setattr(animation, "time", clock)
    kept = animation.Animation()
    kept.save(tmp_path / "none.gif")
    assert not (tmp_path / "none.gif").exists()
    for value in (0, 80, 160, 240):
        kept.take(np.full((54, 96, 3), value, np.uint8))
        clock.now += 0.25
    kept.save(tmp_path / "demo.gif")
    with Image.open(tmp_path / "demo.gif") as gif:
        assert gif.n_frames == 2 and gif.size == (480, 270), "at 0 and 0.5 s"
        assert gif.info["duration"] == 200 and gif.info["loop"] == 0


def test_a_long_animation_has_fewer_frames_and_its_pace(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    clock = Clock()
    monkeypatch.setattr(animation, "time", clock)
    monkeypatch.setattr(animation, "_MOST", 4)
    kept = animation.Animation()
    for number in range(9):  # at 0, 0.4, ... 1.6 s, of which 0, 0.8 and 1.6 stay, then 2.4 and 3.2: 0, 1.6 and 3.2
        kept.take(np.full((54, 96, 3), 25 * number, np.uint8))
        clock.now += 0.401
    kept.save(tmp_path / "demo.gif")
    with Image.open(tmp_path / "demo.gif") as gif:
        shown = []
        for number in range(gif.n_frames):
            gif.seek(number)
            shown.append(round(float(np.asarray(gif.convert("L")).mean()) / 25))
            assert gif.info["duration"] == 800, "1.6 s at twice the pace"
    assert shown == [0, 4, 8]


def test_an_animation_shows_the_colours_of_small_things_and_no_noise(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    clock, rng = Clock(), np.random.default_rng(0)
    monkeypatch.setattr(animation, "time", clock)
    kept = animation.Animation()
    for row in (100, 100, 300):  # a red block, which moves once, on a grainy table, beside a blue one
        frame = np.clip(rng.normal(80, 4, (540, 960, 3)), 0, 255).astype(np.uint8)
        frame[row : row + 20, 200:220] = (230, 40, 30)
        frame[300:320, 700:720] = (20, 60, 220)
        kept.take(frame)
        clock.now += 1.0
    kept.save(tmp_path / "demo.gif")
    shown = []
    with Image.open(tmp_path / "demo.gif") as gif:
        for number in range(gif.n_frames):
            gif.seek(number)
            shown.append(np.asarray(gif.convert("RGB")).astype(int))
            durations = gif.info["duration"]
    assert len(shown) == 2 and durations == 200, "two frames that show the same are one that is shown twice as long"
    before, after = shown
    assert np.abs(before[55, 105] - (230, 40, 30)).max() < 16 and np.abs(after[155, 105] - (230, 40, 30)).max() < 16
    assert np.abs(after[55, 105] - 80).max() < 30, "where the block was lies the table"
    assert np.abs(before[155, 355] - (20, 60, 220)).max() < 16
    assert (before[200:, :] == after[200:, :]).all(), "no grain where nothing moves"
