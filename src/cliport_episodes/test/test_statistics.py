"""What a data set shows, counted and drawn."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from cliport_core.action import PickPlaceAction, Primitive
from cliport_core.pose import PlanarPose
from cliport_core.workspace import WorkspaceSpec
from cliport_episodes.contact_sheet import draw_contact_sheet
from cliport_episodes.data_set import DataSet, draw_statistics
from cliport_episodes.demonstration import Source, StepRecord
from cliport_episodes.errors import DiskError
from cliport_episodes.statistics import Statistics, count_statistics
from cliport_episodes.summary import EpisodeInfo


def count(*episodes: list[StepRecord], success: bool | None = True) -> Statistics:
    infos = [EpisodeInfo(str(n), success, True, 0, (), tuple(records)) for n, records in enumerate(episodes)]
    return count_statistics(infos, WorkspaceSpec())


def test_steps_are_counted(record: StepRecord) -> None:
    action = replace(record.action, primitive=Primitive.SWEEP)
    sweep = replace(record, instruction="Sweep the RED, red and blue blocks", action=action, source=Source.EXPERT)
    s = count([record, sweep], [replace(record, result=None)], [])
    assert (s.n_episodes, s.n_steps, s.n_executed, s.success) == (2, 3, 2, {"success": 2})
    assert s.instructions == {record.instruction: 2, sweep.instruction: 1}
    assert s.color_words == {"red": 3, "green": 2, "blue": 1}
    assert s.primitives == {"pick_place": 2, "sweep": 1} and s.sources == {"clicked": 2, "expert": 1}


def test_positions_are_counted_on_the_heightmaps_grid(record: StepRecord) -> None:
    workspace = WorkspaceSpec()
    s = count([record, replace(record, action=replace(record.action, place=PlanarPose(2.0, 0.0, 0.0)))])
    assert s.picks.shape == workspace.shape and s.picks[workspace.xy_to_pixel(0.4, -0.1)] == 2
    assert s.places.sum() == 1 and s.outside == 1 and "outside the workspace" in s.biases()[-1]
    squares = s.squares(s.picks)
    assert squares.shape == (8, 4) and squares[3, 1] == 2


def test_bias_is_said(record: StepRecord) -> None:
    rng = np.random.default_rng(0)

    def at(x: float, y: float, text: str) -> StepRecord:
        action = PickPlaceAction(PlanarPose(x, y, 0.0), PlanarPose(0.9 - x, -y, 0.0))
        return replace(record, action=action, instruction=text)

    even = [at(rng.uniform(0.25, 0.65), rng.uniform(-0.4, 0.4), f"put block {n}") for n in range(80)]
    assert count(even).biases() == ()
    right = [at(rng.uniform(0.25, 0.65), rng.uniform(-0.4, -0.1), "put the red block") for _ in range(20)]
    lines = count(right).biases()
    assert any("picks lie in the left half" in line for line in lines)
    assert any("places lie in the right half" in line for line in lines)
    assert any(line.startswith("0 % of the picks lie in the left half") for line in lines)
    one_of_20 = count([*right[:19], at(0.5, 0.3, "put it")]).biases()
    assert any(line.startswith("5 % of the picks lie in the left half") for line in one_of_20)
    assert any("colour 'red'" in line for line in lines) and any(
        "instruction 'put the red block'" in line for line in lines
    )
    assert any("one square" in line for line in count([record] * 20).biases())
    for x, y, empty in ((0.44, -0.01, {"left", "far"}), (0.46, 0.01, {"right", "near"})):  # beside the middle
        lines = count([at(x, y, "put it")] * 20).biases()
        assert {
            line.split(" half ")[0].split()[-1] for line in lines if "picks lie" in line and "half" in line
        } == empty


def test_an_empty_data_set_has_statistics(data_set: DataSet, tmp_path: Path) -> None:
    s = data_set.statistics()
    assert s.n_steps == 0 and s.biases() == () and json.loads(json.dumps(s.to_dict()))["n_steps"] == 0
    draw_statistics(s, tmp_path / "empty.png")
    assert cv2.imread(str(tmp_path / "empty.png")) is not None


def test_the_picture_shows_the_bias(record: StepRecord, tmp_path: Path) -> None:
    texts = ("put it there", "把红色方块放进碗里", "a long instruction " * 26)
    s = count([replace(record, instruction=text) for text in texts] * 5)
    draw_statistics(s, tmp_path / "s.png")
    picture = cv2.imread(str(tmp_path / "s.png"))
    assert picture is not None and picture.shape[1] == 1000 and (picture != 255).any(axis=2).mean() > 0.01
    with pytest.raises(DiskError, match="nowhere"):
        draw_statistics(s, tmp_path / "nowhere" / "s.png")


def test_every_bias_is_on_the_picture(record: StepRecord, tmp_path: Path) -> None:
    """A square table, ten instructions and a long list of biases."""
    workspace = WorkspaceSpec(x_min=0.0, x_max=1.0, y_min=-0.5, y_max=0.5)
    action = replace(record.action, pick=PlanarPose(0.1, -0.4, 0.0), place=PlanarPose(0.1, -0.4, 0.0))
    records = tuple(replace(record, action=action, instruction=f"put it on {n} red ones") for n in range(10))
    s = count_statistics([EpisodeInfo("0", True, True, 0, (), records * 2)], workspace)
    assert len(s.biases()) > 4
    draw_statistics(s, tmp_path / "s.png")
    picture = cv2.imread(str(tmp_path / "s.png"))
    assert picture is not None
    assert len(picture) == 870 + 26 * len(s.biases())
    lines = [picture[row - 20 : row] for row in range(len(picture) - 26 * (len(s.biases()) - 1), len(picture), 26)]
    assert len(lines) > 3 and all((line != 255).any() for line in lines)


def test_a_sheet_shows_each_step_and_its_boxes(
    data_set: DataSet, add_episode: Callable[..., str], tmp_path: Path
) -> None:
    name = add_episode(data_set.path, 2)
    broken = data_set.path / "episodes" / name / "step_001.mcap"
    draw_contact_sheet(data_set.episode(name), tmp_path / "sheet.png")
    sheet = cv2.imread(str(tmp_path / "sheet.png"))
    assert sheet is not None and sheet.shape[1] == 3 * 488
    pick_edge = sheet[40 + 75, 200]  # the box's upper edge, 10 of 48 rows down
    right_edge = sheet[40 + 120, 225]  # 30 of 64 columns
    for edge in (pick_edge, right_edge):
        assert edge[2] > 200 and edge[0] < 100
    broken.write_bytes(b"")
    draw_contact_sheet(data_set.episode(name), tmp_path / "sheet.png")
