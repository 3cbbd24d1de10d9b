"""Data generation: what is written is what was seen, the same again, and continued where it stopped."""

import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pyarrow.parquet as pq
import pytest

from cliport_benchmark import generate as module
from cliport_benchmark import generate_cli
from cliport_benchmark.episode_recorder import Hand, record_episode
from cliport_benchmark.errors import DataFolderError, OptionError
from cliport_benchmark.generate import GenerateConfig, Mode, PartReport, generate, make_part
from cliport_benchmark.json_files import read_json
from cliport_benchmark.observer import Observer
from cliport_benchmark.variation import Variation
from cliport_core import PickPlaceAction, WorkspaceSpec
from cliport_policy.data.dataset_format import (
    HEIGHT_UNIT,
    Row,
    decode_heightmap,
    encode_heightmap,
    part_path,
    read_part,
)
from cliport_policy.data.demonstrations import load_demonstrations
from cliport_policy.errors import DataError
from sim_bridge.colors import COLORS, SEEN_PALETTE
from sim_bridge.errors import PhysicsError
from sim_bridge.rendering.camera import RgbdFrame
from sim_bridge.scene import scene_rng
from sim_bridge.task_mechanics.object_at import object_at
from sim_bridge.tasks import TASKS, Split, Task
from sim_bridge.world import SimWorld

TASK = "put-blocks-in-bowls-seen-colors"
SEQUENCE = "stack-block-pyramid-seq-seen-colors"
CONFIG = GenerateConfig(TASK, "train", 0, 2, goals_per_scene=4, variation=Variation.parse("all"))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("data")
    make_part(CONFIG, folder, 0)
    return folder


def test_rows_read_back_and_demos_lie_on_what_they_name(folder: Path) -> None:
    workspace = WorkspaceSpec()
    rows = read_part(part_path(folder, 0), workspace)
    assert {row.episode for row in rows} == {0, 1}
    for row in rows:
        assert (row.task, row.split) == (TASK, "train")
        own = row.demos[0]
        last = row is rows[-1] or row.step > rows[rows.index(row) + 1].step
        assert own.done == last
        assert len({d.instruction for d in row.demos}) == len(row.demos) <= 4
        for demo in row.demos:
            assert demo.primitive == "pick_place"
            _, _, block, *_, bowl, _ = demo.instruction.split()
            assert demo.instruction == f"put the {block} blocks in a {bowl} bowl"
            assert block in SEEN_PALETTE and bowl in SEEN_PALETTE
            if demo.done:
                assert demo.pick_row == demo.place_col == -1
                continue
            assert min(abs(demo.pick_yaw_period - period) for period in (np.pi / 2, np.pi)) < 1e-4
            color = row.heightmap.color[demo.pick_row - 1 : demo.pick_row + 2, demo.pick_col]
            assert closest(color.mean(axis=0)) == block
            assert row.heightmap.height[demo.pick_row, demo.pick_col] == pytest.approx(0.04, abs=0.012)
            assert 0 < row.heightmap.height[demo.place_row, demo.place_col] < 0.03


def closest(color: np.ndarray) -> str:
    """The palette's colour of the same hue and saturation, whatever the light."""
    unit = color / np.linalg.norm(color)
    return max(SEEN_PALETTE, key=lambda name: float(unit @ np.array(COLORS[name]) / np.linalg.norm(COLORS[name])))


def test_same_settings_make_the_same_bytes(folder: Path, tmp_path: Path) -> None:
    make_part(CONFIG, tmp_path, 0)
    assert part_path(tmp_path, 0).read_bytes() == part_path(folder, 0).read_bytes()


def test_mistakes_are_seen_and_put_right(tmp_path: Path) -> None:
    rows = {}
    for share in (0.0, 1.0):
        config = GenerateConfig("assembling-kits-seq-seen-colors", "train", 0, 1, mistakes=share)
        (tmp_path / str(share)).mkdir()
        assert make_part(config, tmp_path / str(share), 0).discarded == 0
        rows[share] = read_part(part_path(tmp_path / str(share), 0), WorkspaceSpec())
    for plain, wrong in zip(rows[0.0][:5], rows[1.0][:5], strict=True):
        assert plain.demos[0].instruction == wrong.demos[0].instruction and not wrong.demos[0].done
        moved = math.dist(*((d.pick_row, d.pick_col) for d in (plain.demos[0], wrong.demos[0])))
        assert moved > 10, "the piece lies elsewhere"
        assert (wrong.demos[0].place_row, wrong.demos[0].place_col) != (-1, -1)
    assert rows[1.0][-1].demos[0].done and len(rows[1.0]) == 6


def test_a_row_needs_no_code_of_this_project(folder: Path) -> None:
    row = pq.read_table(part_path(folder, 0)).to_pylist()[0]
    names = ["task", "split", "seed", "episode", "step", "color_png", "height_png", "valid_png", "demos", "things"]
    assert list(row) == names
    color, height, valid = (
        cv2.imdecode(np.frombuffer(row[name], np.uint8), cv2.IMREAD_UNCHANGED) for name in names[5:8]
    )
    assert color.shape == (320, 160, 3) and height.shape == valid.shape == (320, 160)
    meta = CONFIG.settings()
    metres = height * meta["height_unit"] + meta["workspace"]["z_min"]
    demo = row["demos"][0]
    assert height.dtype == np.uint16 and metres[demo["pick_row"], demo["pick_col"]] == pytest.approx(0.04, abs=0.012)


def test_a_step_takes_less_than_a_hundred_kilobytes(tmp_path: Path) -> None:
    make_part(replace(CONFIG, variation=Variation()), tmp_path, 0)
    path = part_path(tmp_path, 0)
    assert path.stat().st_size < 100_000 * pq.read_metadata(path).num_rows


def test_what_is_stored_is_what_was_seen_to_within_the_noise(folder: Path) -> None:
    seen = read_part(part_path(folder, 0), WorkspaceSpec())[0].heightmap
    again = decode_heightmap(*encode_heightmap(seen), WorkspaceSpec())
    assert np.array_equal(again.color, seen.color) and np.array_equal(again.valid, seen.valid)
    finer = replace(seen, color=seen.color | 1, height=seen.height + np.float32(0.0002))
    stored = decode_heightmap(*encode_heightmap(finer), WorkspaceSpec())
    assert np.abs(stored.color.astype(int) - finer.color).max() <= 1
    assert np.abs(stored.height - finer.height)[seen.valid].max() <= HEIGHT_UNIT / 2 + 1e-6


def test_a_sequence_has_a_sentence_a_step_and_ends_under_its_last(tmp_path: Path) -> None:
    config = GenerateConfig(SEQUENCE, "train", 0, 1)
    module._open_folder(config, tmp_path, {})
    report = make_part(config, tmp_path, 0)
    rows = read_part(part_path(tmp_path, 0), WorkspaceSpec())
    assert report.discarded == 0 and [row.step for row in rows] == list(range(len(rows))) and len(rows) >= 7
    sentences = [row.demos[0].instruction for row in rows]
    assert len(set(sentences)) == 6 and sentences[-1] == sentences[-2]
    assert [row.demos[0].done for row in rows] == [False] * (len(rows) - 1) + [True]
    frames = load_demonstrations(tmp_path).frames
    assert [frame.demos[0].instruction for frame in frames] == sentences


def test_each_goal_of_a_sequence_is_shown_reached_and_the_things_are_listed(tmp_path: Path) -> None:
    config = GenerateConfig(SEQUENCE, "train", 0, 1)
    module._open_folder(config, tmp_path, {})
    make_part(config, tmp_path, 0)
    said: list[str] = []
    for row in read_part(part_path(tmp_path, 0), WorkspaceSpec()):
        own, *others = row.demos
        done = {demo.instruction for demo in others}
        assert all(demo.done for demo in others) and own.instruction not in done
        assert done == set(said) - {own.instruction}
        if not said or said[-1] != own.instruction:
            said.append(own.instruction)
        assert len(row.things) == 7 and {thing.name for thing in row.things} == {"stand", "block"}
        blocks = [thing for thing in row.things if thing.name == "block"]
        assert all(thing.rgb == int("{:02x}{:02x}{:02x}".format(*COLORS[thing.color]), 16) for thing in blocks)
        if row.step == 0:
            at = [row.heightmap.height[thing.row, thing.col] for thing in blocks]
            assert min(at) > 0.03
    assert len(said) == 6
    frame = load_demonstrations(tmp_path).frames[0]
    assert ("", "stand") in frame.things and len(frame.things) == 7


def test_only_the_first_parts_are_made_when_so_asked(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[list[int]] = []

    def run(make: object, parts: list[int], *rest: object) -> Iterator[tuple[int, PartReport]]:
        asked.append(parts)
        yield from ()

    monkeypatch.setattr(module, "run_parallel", run)
    config = GenerateConfig(TASK, "train", 0, 4, episodes_per_part=1)
    for first_parts in (3, 9, None):
        generate(config, tmp_path / "set", 1, {}, lambda report, left: None, first_parts)
    assert asked == [[0, 1, 2], [0, 1, 2, 3], [0, 1, 2, 3]]


class Measuring:
    """A hand that notes how far from its place each thing came to rest [m]."""

    def __init__(self, world: SimWorld, hand: Hand) -> None:
        self.world, self.hand, self.errors = world, hand, list[float]()

    def execute(self, action: PickPlaceAction, frame: RgbdFrame) -> object:
        thing = object_at(self.world, action.pick.x, action.pick.y, movable=True)
        assert thing is not None
        result = self.hand.execute(action, frame)
        self.errors.append(math.hypot(*(self.world.object_xy(thing) - (action.place.x, action.place.y))))
        return result


@pytest.mark.soak  # half a minute on a slow machine
def test_both_modes_begin_alike_and_place_alike(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    hands: list[Measuring] = []

    def record(world: SimWorld, task: Task, observer: Observer, hand: Hand, *rest: Any) -> list[Row] | None:
        hands.append(Measuring(world, hand))
        return record_episode(world, task, observer, hands[-1], *rest)

    monkeypatch.setattr(module, "record_episode", record)
    rows, errors = {}, {}
    for mode in Mode:
        hands.clear()
        (tmp_path / mode.value).mkdir()
        config = GenerateConfig(TASK, "val", 5022, 2, mode=mode)
        assert make_part(config, tmp_path / mode.value, 0).discarded == 0  # every score is 1
        rows[mode] = read_part(part_path(tmp_path / mode.value, 0), WorkspaceSpec())
        errors[mode] = [error for hand in hands for error in hand.errors]
    assert [(r.episode, r.step) for r in rows[Mode.FAST]] == [(r.episode, r.step) for r in rows[Mode.PHYSICS]]
    for fast, physics in zip(rows[Mode.FAST], rows[Mode.PHYSICS], strict=True):
        if fast.step == 0:
            assert fast.demos == physics.demos
            for name in ("color", "height", "valid"):
                np.testing.assert_array_equal(getattr(fast.heightmap, name), getattr(physics.heightmap, name))
    assert len(errors[Mode.FAST]) == len(errors[Mode.PHYSICS]) >= 4
    assert max(*errors[Mode.FAST], *errors[Mode.PHYSICS]) < 0.008
    assert abs(np.mean(errors[Mode.FAST]) - np.mean(errors[Mode.PHYSICS])) < 0.0015


def test_each_part_is_told_of_with_how_many_are_left(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    reports = [PartReport(index, 1, 1, 0) for index in range(3)]
    monkeypatch.setattr(module, "run_parallel", lambda *_: (item for item in enumerate(reports)))
    told: list[tuple[PartReport, int]] = []
    config = GenerateConfig(TASK, "train", 0, 3, episodes_per_part=1)
    generate(config, tmp_path / "set", 1, {}, lambda report, left: told.append((report, left)))
    assert told == list(zip(reports, (2, 1, 0), strict=True))


def test_complete_parts_are_kept_and_other_settings_refused(tmp_path: Path) -> None:
    config = replace(CONFIG, episodes=2, episodes_per_part=1)
    reports: list[tuple[PartReport, int]] = []
    part_path(tmp_path / "set", 0).parent.mkdir()
    module._open_folder(config, tmp_path / "set", {"command": "test", "commit": "none"})
    part_path(tmp_path / "set", 0).write_bytes(b"already here")
    part_path(tmp_path / "set", 1).write_bytes(b"already here")
    generate(config, tmp_path / "set", 1, {}, lambda report, left: reports.append((report, left)))
    assert not reports
    assert read_json(tmp_path / "set" / "meta.json")["command"] == "test"
    with pytest.raises(DataFolderError, match=r"randomize .* not False"):
        generate(replace(config, variation=Variation()), tmp_path / "set", 1, {}, lambda report, left: None)
    with pytest.raises(DataFolderError, match="choose another --out"):
        generate(config, tmp_path, 1, {}, lambda report, left: None)
    with pytest.raises(DataError, match="generate it again"):
        read_part(part_path(tmp_path / "set", 0), WorkspaceSpec())


def test_command_line_makes_only_the_missing_part(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ["--task", TASK, "--episodes", "2", "--goals-per-scene", "4", "--randomize"]
    arguments += ["--processes", "1", "--out", str(tmp_path / "new")]
    assert generate_cli.main(arguments) == 0
    assert part_path(tmp_path / "new", 0).read_bytes() == part_path(folder, 0).read_bytes()
    meta = read_json(tmp_path / "new" / "meta.json")
    assert meta["task"] == TASK and meta["episodes"] == 2 and "generate --task" in meta["command"]
    assert generate_cli.main(arguments) == 0
    assert "ETA" not in capsys.readouterr().out.split("complete", 1)[1]


def test_an_episode_that_explodes_is_counted_and_left_out(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def explode(world: SimWorld) -> bool:
        raise PhysicsError("the red block flew off")

    with monkeypatch.context() as patch:
        patch.setattr(SimWorld, "settle", explode)
        report = make_part(replace(CONFIG, episodes=1), tmp_path, 0)
    assert (report.episodes, report.observations, report.discarded) == (1, 0, 1)


def test_splits_share_no_seed_in_any_task() -> None:
    """A scene is drawn from (task, split, seed), so two splits cannot hold the same scene."""
    draws = {
        tuple(scene_rng(task, split, seed).integers(0, 2**63, size=2))
        for task in TASKS
        for split in Split
        for seed in (0, 1, 2, 9999, 10001)
    }
    assert len(draws) == len(TASKS) * len(Split) * 5


@pytest.mark.parametrize(
    ("extra", "message"),
    [
        (["--task", "put-blocks-in-bowls"], "did you mean put-blocks-in-bowls-"),
        (["--split", "trian"], "did you mean train"),
        (["--episodes", "0"], "--episodes must be 1 or more, got 0"),
        (["--first-seed", "-3"], "--first-seed must be 0 or more, got -3"),
        (["--processes", "0"], "--processes must be 1 or more"),
        (["--goals-per-scene", "0"], "--goals-per-scene must be 1 or more"),
        (["--goals-per-scene", "2", "--task", SEQUENCE], "--goals-per-scene must be 1 for stack-block-pyramid"),
        (["--out", "/proc/none"], "cannot write /proc/none"),
    ],
)
def test_bad_input_is_one_clear_line(
    extra: list[str], message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ["--task", TASK, "--episodes", "1", "--out", str(tmp_path / "x"), *extra]
    assert generate_cli.main(arguments) == 1
    error = capsys.readouterr().err
    assert error.startswith("error: ") and message in error and error.count("\n") == 1


def test_config_refuses_what_makes_no_data_set() -> None:
    with pytest.raises(OptionError):
        GenerateConfig(TASK, "train", 0, -1)
