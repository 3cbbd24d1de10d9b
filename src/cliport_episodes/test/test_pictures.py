"""Layout of the pictures: texts where they belong, areas in the colours that say what they are."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from cliport_core.action import PickPlaceAction
from cliport_core.pose import PlanarPose
from cliport_core.workspace import WorkspaceSpec
from cliport_episodes import contact_sheet, statistics_picture
from cliport_episodes.data_set import DataSet
from cliport_episodes.demonstration import StepRecord
from cliport_episodes.drawing import PICK_COLOR, PLACE_COLOR
from cliport_episodes.statistics import Statistics, count_statistics
from cliport_episodes.summary import EpisodeInfo

Text = tuple[str, int, int, int]


@pytest.fixture
def texts(monkeypatch: pytest.MonkeyPatch) -> list[Text]:
    """Texts as they are written: what, row, column, size. Nothing of them is drawn, so that areas can be looked at."""
    found: list[Text] = []

    def note(picture: object, text: str, row: int, col: int, size: int = 16, color: object = None) -> None:
        found.append((text, row, col, size))

    monkeypatch.setattr(statistics_picture, "write_text", note)
    monkeypatch.setattr(contact_sheet, "write_text", note)
    return found


def read(path: Path) -> np.ndarray:
    picture = cv2.imread(str(path))
    assert picture is not None
    return picture[..., ::-1]


def statistics_of(record: StepRecord, pick: tuple[float, float], place: tuple[float, float], n: int = 3) -> Statistics:
    action = PickPlaceAction(PlanarPose(*pick, 0.0), PlanarPose(*place, 0.0))
    records = [replace(record, action=action, instruction=f"put it {'again' if i else 'there'}") for i in range(n)]
    return count_statistics([EpisodeInfo("0", True, True, 0, (), tuple(records))], WorkspaceSpec())


def test_statistics_are_written_beside_their_maps(record: StepRecord, texts: list[Text], tmp_path: Path) -> None:
    statistics_picture.draw_statistics(statistics_of(record, (0.3, 0.35), (0.6, -0.35)), tmp_path / "s.png")
    assert texts[0] == ("3 steps in 1 episodes (1 success)", 34, 30, 22)
    assert ("picks in 1 of 32 squares of 10 cm", 72, 30, 16) in texts
    assert ("places in 1 of 32 squares of 10 cm", 72, 530, 16) in texts
    assert [text for text, _, col, _ in texts if col in (30, 85) and text.startswith(("instructions", "put"))] == [
        "instructions (2)",
        "put it again",
        "put it there",
    ]
    bars = {text: (row, col) for text, row, col, size in texts if size == 15}
    assert bars["put it there"][0] - bars["put it again"][0] == 26
    assert bars["2"] == (bars["put it again"][0], 30) and bars["1"] == (bars["put it there"][0], 30)


def test_squares_are_shaded_by_their_counts(record: StepRecord, texts: list[Text], tmp_path: Path) -> None:
    """Seen from behind the robot: +y to the left, +x up; a square of 10 cm is 55 pixels wide."""
    statistics_picture.draw_statistics(statistics_of(record, (0.26, 0.39), (0.64, -0.39)), tmp_path / "s.png")
    picture = read(tmp_path / "s.png")
    assert [text for text in texts if text[3] == 14] == [
        ("3", 84 + 165 + 18, 30 + 5, 14),
        ("3", 84 + 18, 530 + 385 + 5, 14),
    ]
    pick, place = picture[84 + 220 - 20, 30 + 20], picture[84 + 20, 530 + 440 - 20]
    for seen, color in ((pick, PICK_COLOR), (place, PLACE_COLOR)):
        np.testing.assert_allclose(seen, [255 - 0.75 * (255 - c) for c in color], atol=1)
    assert (picture[84 + 20, 50] == 255).all() and (picture[84 + 200, 530 + 420] == 255).all()
    dots = np.argwhere((picture < 60).all(axis=2))
    left, right = dots[dots[:, 1] < 500], dots[dots[:, 1] > 500]
    scale = 440 / 320
    np.testing.assert_allclose(left.mean(axis=0), (84 + 220 - 4.5 * scale, 30 + 4.5 * scale), atol=1.5)
    np.testing.assert_allclose(right.mean(axis=0), (84 + 4.5 * scale, 530 + 440 - 4.5 * scale), atol=1.5)


def test_bars_are_as_long_as_their_counts(record: StepRecord, texts: list[Text], tmp_path: Path) -> None:
    statistics_picture.draw_statistics(statistics_of(record, (0.3, 0.35), (0.6, -0.35), n=4), tmp_path / "s.png")
    bar = (read(tmp_path / "s.png")[:, :500] == (215, 225, 240)).all(axis=2)
    rows = np.flatnonzero(bar.any(axis=1))
    first, second = rows[: len(rows) // 2], rows[len(rows) // 2 :]
    assert len(first) == len(second) == 21 and second[0] - first[0] == 26
    lengths = [np.flatnonzero(bar[block].any(axis=0)) for block in (first, second)]
    assert all(bar[np.ix_(block, cols)].all() for block, cols in zip((first, second), lengths, strict=True))
    assert [int(cols[0]) for cols in lengths] == [80, 80]
    assert [len(cols) - 1 for cols in lengths] == [380, round(380 / 3)]


@pytest.mark.parametrize(("mark", "word"), [(True, "success"), (False, "failure"), (None, "unmarked")])
def test_a_sheet_says_how_the_episode_was_marked(
    data_set: DataSet,
    add_episode: Callable[..., str],
    texts: list[Text],
    tmp_path: Path,
    mark: bool | None,
    word: str,
) -> None:
    episode = data_set.episode(add_episode(data_set.path, 2))
    contact_sheet.draw_contact_sheet(replace(episode, success=mark), tmp_path / "sheet.png")
    assert texts[-1] == (f"{episode.name}   2 steps, {word}", 26, 8, 18)
    captions = [(text, row, col) for text, row, col, size in texts if size == 16]
    assert captions[0] == (f"0  {episode.steps[0].record.instruction}", 20, 4)
    assert captions[-1] == ("after the last step", 20, 4)


def test_a_bar_along_the_yaw_reaches_as_far_to_either_side(
    data_set: DataSet, add_episode: Callable[..., str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The camera of these tests sees the table nearly without foreshortening along the image's rows."""
    lines: list[tuple[tuple[int, int], tuple[int, int]]] = []
    middles: list[tuple[int, int]] = []
    monkeypatch.setattr(contact_sheet.cv2, "line", lambda picture, start, end, *_: lines.append((start, end)))
    monkeypatch.setattr(contact_sheet.cv2, "circle", lambda picture, middle, *_: middles.append(middle))
    episode = data_set.episode(add_episode(data_set.path, 1))
    contact_sheet.draw_contact_sheet(episode, tmp_path / "sheet.png")
    assert len(lines) == len(middles) == 4  # pick and place, each white and then in its colour
    for (start, end), middle in zip(lines, middles, strict=True):
        before, after = np.subtract(middle, start), np.subtract(end, middle)
        assert np.linalg.norm(before) > 10
        assert 0.7 < np.linalg.norm(before) / np.linalg.norm(after) < 1.4
