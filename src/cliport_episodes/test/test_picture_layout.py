"""Every stroke of the pictures, as drawn on a small table and of a small episode, computed by hand."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from cliport_core.action import PickPlaceAction
from cliport_core.pose import PlanarPose
from cliport_core.workspace import WorkspaceSpec
from cliport_episodes import contact_sheet, statistics_picture
from cliport_episodes.data_set import DataSet
from cliport_episodes.demonstration import PixelBox, StepRecord
from cliport_episodes.drawing import FAINT, INK, PICK_COLOR, PLACE_COLOR, write_text
from cliport_episodes.statistics import count_statistics
from cliport_episodes.summary import EpisodeInfo

Stroke = tuple[Any, ...]
WHITE = (255, 255, 255)


@pytest.fixture
def strokes(monkeypatch: pytest.MonkeyPatch) -> list[Stroke]:
    """What is drawn, in order: (kind, its arguments); nothing of it is drawn in earnest."""
    found: list[Stroke] = []

    def note(_: object, text: str, row: int, col: int, size: int = 16, color: object = INK) -> None:
        found.append(("text", text, row, col, size, color))

    for module in (statistics_picture, contact_sheet):
        monkeypatch.setattr(module, "write_text", note)
    for kind in ("rectangle", "circle", "line"):
        monkeypatch.setattr(cv2, kind, lambda _, *arguments, kind=kind: found.append((kind, *arguments)))
    return found


def read(path: Path) -> np.ndarray:
    picture = cv2.imread(str(path))
    assert picture is not None
    return picture[..., ::-1]


def test_colours_are_those_of_every_picture() -> None:
    """Also of the page's."""
    assert (INK, FAINT) == ((30, 30, 30), (150, 150, 150))
    assert (PICK_COLOR, PLACE_COLOR) == ((225, 50, 50), (20, 150, 70))


def test_every_stroke_of_the_statistics(record: StepRecord, strokes: list[Stroke], tmp_path: Path) -> None:
    """Two squares of 10 cm by three: 40 cells of 2.5 mm are 220 pixels wide."""
    workspace = WorkspaceSpec(x_min=0.25, x_max=0.55, y_min=-0.1, y_max=0.1)
    near, far, beside = (PlanarPose(*xy, 0.0) for xy in ((0.2612, -0.0888), (0.5388, 0.0888), (2.0, 0.0)))
    actions = [(near, far)] * 3 + [(far, beside)]
    records = tuple(
        replace(record, action=PickPlaceAction(*action), instruction="put red" if i else "push red")
        for i, action in enumerate(actions)
    )
    statistics_picture.draw_statistics(
        count_statistics([EpisodeInfo("0", False, True, 0, (), records)], workspace), tmp_path / "s.png"
    )
    height, bottom = 660, 84 + 660  # of a map
    expected: list[Stroke] = [("text", "4 steps in 1 episodes (1 failure)", 34, 30, 22, INK)]
    for name, color, col, counts in (
        ("picks in 2", PICK_COLOR, 30, {(0, 0): 3, (1, 2): 1}),
        ("places in 1", PLACE_COLOR, 530, {(1, 2): 3}),
    ):
        expected.append(("text", f"{name} of 6 squares of 10 cm", 72, col, 16, INK))
        for row in range(2):
            for column in range(3):
                count = counts.get((row, column), 0)
                shade = tuple(round(255 - 0.25 * count * (255 - c)) for c in color)
                corners = (
                    (col + 220 * (1 - row), bottom - 220 * (column + 1)),
                    (
                        col + 220 * (2 - row),
                        bottom - 220 * column,
                    ),
                )
                expected += [("rectangle", *corners, shade, -1), ("rectangle", *corners, FAINT, 1)]
                if count:
                    expected.append(("text", str(count), corners[0][1] + 18, corners[0][0] + 5, 14, INK))
        cells = {(0, 0): (4, 4), (1, 2): (75, 115)}
        for square in counts:
            row, column = cells[square]
            at = round(col + 440 - (row + 0.5) * 5.5), round(bottom - (column + 0.5) * 5.5)
            expected.append(("circle", at, 2, INK, -1, cv2.LINE_AA))
    top = bottom + 40  # of the bars
    bars = (30, "instructions (2)", [("put red", 3), ("push red", 1)]), (530, "colour words (1)", [("red", 4)])
    for col, title, counted in bars:
        expected.append(("text", title, top, col, 16, INK))
        for number, (words, count) in enumerate(counted, start=1):
            at = top + 26 * number
            length = round(380 * count / counted[0][1])
            expected += [
                ("rectangle", (col + 50, at - 16), (col + 50 + length, at + 4), (215, 225, 240), -1),
                ("text", str(count), at, col, 15, INK),
                ("text", words, at, col + 55, 15, INK),
            ]
    biases = bottom + 60 + 26 * 3
    expected.append(("text", "! 1 poses lie outside the workspace: they cannot be learned", biases, 30, 16, PICK_COLOR))
    assert strokes == expected
    assert read(tmp_path / "s.png").shape == (biases + 26, 1000, 3) and height == bottom - 84


def test_no_more_than_ten_instructions_are_listed(record: StepRecord, strokes: list[Stroke], tmp_path: Path) -> None:
    records = tuple(replace(record, instruction=f"put it {n}") for n in range(12))
    counted = count_statistics([EpisodeInfo("0", None, True, 0, (), records)], WorkspaceSpec())
    statistics_picture.draw_statistics(counted, tmp_path / "s.png")
    assert sum(stroke[0] == "text" and stroke[1].startswith("put it") for stroke in strokes) == 10
    assert read(tmp_path / "s.png").shape[0] == 84 + 220 + 60 + 26 * 11 + 26 * len(counted.biases())


def test_cells_of_a_sheet_are_the_observations(
    data_set: DataSet, add_episode: Callable[..., str], strokes: list[Stroke], tmp_path: Path
) -> None:
    """Three steps and the last scene: three cells of 480 x 416 pixels in a row, 8 apart, under a line of 40."""
    episode = data_set.episode(add_episode(data_set.path, 3))
    contact_sheet.draw_contact_sheet(episode, tmp_path / "sheet.png")
    sheet = read(tmp_path / "sheet.png")
    assert sheet.shape == (40 + 2 * 416, 3 * 488, 3)
    assert episode.final is not None
    left_over = sheet.copy()
    for number, seen in enumerate([*(step.observation() for step in episode.steps), episode.final]):
        top, left = 40 + 416 * (number // 3), 488 * (number % 3)
        shown = cv2.resize(seen.color, (480, 360), interpolation=cv2.INTER_AREA)
        np.testing.assert_array_equal(sheet[top : top + 360, left : left + 480], shown)
        left_over[top : top + 360, left : left + 480] = 255
    assert (left_over == 255).all()
    said = [stroke for stroke in strokes if stroke[0] == "text"]
    words = "put the red block in the green bowl"
    details = ("text", "pick_place, clicked, grasp missed: nothing between the fingers", 42, 4, 14, FAINT)
    steps = [each for n in range(3) for each in (("text", f"{n}  {words}", 20, 4, 16, INK), details)]
    end = [("text", "after the last step", 20, 4, 16, INK), ("text", "", 42, 4, 14, FAINT)]
    assert said == [*steps, *end, ("text", f"{episode.name}   3 steps, success", 26, 8, 18, INK)]


def test_bars_and_boxes_of_a_sheet(
    data_set: DataSet, add_episode: Callable[..., str], record: StepRecord, strokes: list[Stroke], tmp_path: Path
) -> None:
    """The pose is projected by hand: 480 of 64 columns are a scale of 7.5."""
    pick, place = PlanarPose(0.4, -0.1, 0.5), PlanarPose(5.0, 0.0, 0.0)
    name = add_episode(data_set.path, 1, action=PickPlaceAction(pick, place), place_box=PixelBox(1, 2, 3, 5))
    episode = data_set.episode(name)
    contact_sheet.draw_contact_sheet(episode, tmp_path / "sheet.png")
    drawn = [stroke for stroke in strokes if stroke[0] != "text"]
    boxes = [stroke for stroke in drawn if stroke[0] == "rectangle"]
    assert boxes == [
        ("rectangle", (150, 75), (225, 135), PICK_COLOR, 2),
        ("rectangle", (15, 8), (38, 22), PLACE_COLOR, 2),
    ]
    seen = episode.steps[0].observation()
    workspace = data_set.setup.workspace
    z = float(seen.heightmap(workspace).height[workspace.xy_to_pixel(pick.x, pick.y)])

    def at(along: float) -> tuple[int, int]:
        point = np.array([pick.x + along * math.cos(0.5), pick.y + along * math.sin(0.5), z])
        x, y, depth = seen.camera_in_base.rotation.T @ (point - seen.camera_in_base.translation)
        return round(7.5 * (60 * x / depth + 31.5)), round(7.5 * (60 * y / depth + 23.5))

    start, middle, end = at(-0.04), at(0.0), at(0.04)
    expected = []
    for ink, thickness in ((WHITE, 3), (PICK_COLOR, 1)):
        expected += [
            ("line", start, end, ink, thickness, cv2.LINE_AA),
            ("circle", middle, 1 + thickness, ink, -1, cv2.LINE_AA),
        ]
    assert [stroke for stroke in drawn if stroke[0] != "rectangle"] == expected  # the place is behind the camera


@pytest.mark.parametrize(
    ("steps", "shape"), [(0, (40 + 416, 488)), (1, (40 + 416, 2 * 488)), (5, (40 + 2 * 416, 3 * 488))]
)
def test_a_sheet_is_as_large_as_its_cells(
    data_set: DataSet,
    add_episode: Callable[..., str],
    strokes: list[Stroke],
    tmp_path: Path,
    steps: int,
    shape: tuple[int, int],
) -> None:
    episode = data_set.episode(add_episode(data_set.path, 1))
    episode = replace(episode, steps=episode.steps * steps, final=episode.final if steps else None)
    contact_sheet.draw_contact_sheet(episode, tmp_path / "sheet.png")
    assert read(tmp_path / "sheet.png").shape[:2] == shape


def test_a_text_is_cut_off_where_it_would_leave_the_picture(monkeypatch: pytest.MonkeyPatch) -> None:
    """Ten pixels a letter."""
    put: list[Stroke] = []
    monkeypatch.setattr("cliport_episodes.drawing._text_width", lambda text, size: 10 * len(text))
    monkeypatch.setattr(cv2, "putText", lambda _, text, at, color, font, size: put.append((text, at, color, size)))
    picture = np.zeros((20, 100, 3), np.uint8)
    for text, col in (("123456789", 2), ("1234567890", 2), ("1234 67890", 42), ("ab", 78), ("abc", 72), ("a", 88)):
        write_text(picture, text, 15, col, 12, FAINT)
    assert put == [
        ("123456789", (2, 15), FAINT, 12),
        ("12345678…", (2, 15), FAINT, 12),
        ("1234…", (42, 15), FAINT, 12),
        ("", (78, 15), FAINT, 12),
        ("a…", (72, 15), FAINT, 12),
        ("", (88, 15), FAINT, 12),
    ]
