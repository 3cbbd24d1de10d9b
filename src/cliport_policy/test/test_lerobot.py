"""Episodes in LeRobot's format and back: what is written, what comes back, and what is refused."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from dataclasses import astuple, replace
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from cliport_core.action import Primitive
from cliport_core.image_files import decode_color_file
from cliport_episodes.data_set import DataSet
from cliport_episodes.reader import Step
from cliport_policy.data import lerobot_format as form
from cliport_policy.data import to_lerobot
from cliport_policy.lerobot import main

MakeEpisode = Callable[..., object]


@pytest.fixture(scope="module")
def recorded(make_episode: MakeEpisode, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two episodes, one of them relabelled, without a judgement; only read."""
    folder = tmp_path_factory.mktemp("recorded") / "set"
    make_episode(folder, "first", seed=1)
    make_episode(folder, "second", success=None, seed=2, outcomes=(0, 3, 0), primitive=Primitive.SWEEP)
    DataSet.open(folder).relabel("second", "sweep the crumbs away", 1)
    return folder


@pytest.fixture(scope="module")
def export(recorded: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What is written of the episodes; only copied."""
    folder = tmp_path_factory.mktemp("export") / "lerobot"
    assert main(["--from-bags", str(recorded), "--out", str(folder)]) == 0
    return folder


@pytest.fixture
def written(export: Path, tmp_path: Path) -> Path:
    return shutil.copytree(export, tmp_path / "lerobot")


def test_pictures_sentences_and_actions_come_back_equal(recorded: Path, written: Path, tmp_path: Path) -> None:
    assert main(["--to-bags", str(written), "--out", str(tmp_path / "back")]) == 0
    before, after = DataSet.open(recorded), DataSet.open(tmp_path / "back")
    assert before.setup.differences(after.setup) == []
    assert [info.name for info in before.episodes()] == [info.name for info in after.episodes()] == ["first", "second"]
    for name in ("first", "second"):
        one, two = before.episode(name), after.episode(name)
        assert (one.success, one.finished) == (two.success, two.finished) and not two.complaints
        for was, came in zip(one.steps, two.steps, strict=True):
            poses = [[*astuple(step.record.action.pick), *astuple(step.record.action.place)] for step in (was, came)]
            np.testing.assert_allclose(*poses, rtol=0, atol=1e-14)  # a yaw is stored as a quaternion
            assert replace(was.record, action=came.record.action) == came.record
            assert was.record.action.primitive is came.record.action.primitive
        assert one.final is not None and two.final is not None
        shown = [(a.observation(), b.observation()) for a, b in zip(one.steps, two.steps, strict=True)]
        for seen, again in [*shown, (one.final, two.final)]:
            assert seen.stamp_ns == again.stamp_ns and seen.joint_positions == again.joint_positions
            np.testing.assert_array_equal(seen.color, again.color)
            np.testing.assert_array_equal(seen.depth_m, again.depth_m)
            change = seen.camera_in_base.inverse() @ again.camera_in_base
            np.testing.assert_allclose(change.rotation, np.eye(3), atol=1e-12)
            np.testing.assert_allclose(change.translation, 0.0, atol=1e-12)
            assert seen.camera == again.camera


def test_the_files_say_what_lerobot_reads(recorded: Path, written: Path) -> None:
    info = json.loads((written / "meta/info.json").read_text())
    assert (info["codebase_version"], info["total_episodes"], info["total_frames"], info["total_tasks"]) == (
        "v3.0",
        2,
        5,
        2,
    )
    assert info["features"][form.COLOR] == {
        "dtype": "image",
        "shape": [120, 160, 3],
        "names": ["height", "width", "channels"],
    }
    assert info["data_path"].format(chunk_index=0, file_index=0) == form.DATA.format(0)
    rows = pq.read_table(written / form.DATA.format(0))
    assert set(rows.column_names) == set(info["features"])
    assert rows["index"].to_pylist() == [0, 1, 2, 3, 4] and rows["frame_index"].to_pylist() == [0, 1, 0, 1, 2]
    assert rows["episode_index"].to_pylist() == [0, 0, 1, 1, 1] and rows["task_index"].to_pylist() == [0, 0, 0, 1, 0]
    assert rows["timestamp"].to_pylist() == [0.0, 1.0, 0.0, 1.0, 2.0]
    steps = DataSet.open(recorded).episode("second").steps
    np.testing.assert_array_equal(decode_color_file(rows[form.COLOR][3].as_py()["bytes"]), steps[1].observation().color)
    action = steps[1].record.action
    wanted = [action.pick.x, action.pick.y, action.pick.yaw, action.place.x, action.place.y, action.place.yaw, 1.0]
    np.testing.assert_allclose(rows[form.ACTION][3].as_py(), wanted, rtol=1e-6)
    episodes = pq.read_table(written / form.EPISODES.format(0)).to_pylist()
    assert [(row["length"], row["dataset_from_index"], row["dataset_to_index"]) for row in episodes] == [
        (2, 0, 2),
        (3, 2, 5),
    ]
    assert episodes[1]["tasks"][1] == "sweep the crumbs away"
    tasks = pq.read_table(written / form.TASKS)
    assert json.loads(tasks.schema.metadata[b"pandas"])["index_columns"] == ["__index_level_0__"]
    assert form.read_tasks(written / form.TASKS)[1] == "sweep the crumbs away"


def test_statistics_are_those_of_the_rows(recorded: Path, written: Path) -> None:
    stats = json.loads((written / "meta/stats.json").read_text())
    data_set = DataSet.open(recorded)
    colors = [step.observation().color / 255.0 for name in ("first", "second") for step in data_set.episode(name).steps]
    for key, value in {"mean": np.mean, "std": np.std, "min": np.min, "max": np.max}.items():
        np.testing.assert_allclose(np.squeeze(stats[form.COLOR][key]), value(colors, axis=(0, 1, 2)), atol=1e-9)
    assert np.shape(stats[form.COLOR]["mean"]) == (3, 1, 1) and stats[form.COLOR]["count"] == [5]
    assert stats["index"]["mean"] == [2.0] and stats["index"]["std"] == pytest.approx([2**0.5])
    assert stats[form.ACTION]["min"][6] == 0.0 and stats[form.ACTION]["max"][6] == 1.0


def test_many_pictures_are_shared_among_files(recorded: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(to_lerobot, "_BYTES_PER_FILE", 1)
    assert main(["--from-bags", str(recorded), "--out", str(tmp_path / "two")]) == 0
    episodes = pq.read_table(tmp_path / "two" / form.EPISODES.format(0)).to_pylist()
    assert [row["data/file_index"] for row in episodes] == [0, 1]
    assert pq.read_table(tmp_path / "two" / form.DATA.format(1)).num_rows == 3
    assert main(["--to-bags", str(tmp_path / "two"), "--out", str(tmp_path / "back")]) == 0


def test_a_sentence_that_was_edited_there_counts(written: Path, tmp_path: Path) -> None:
    form.write_tasks(written / form.TASKS, ["put it there", "sweep"])
    assert main(["--to-bags", str(written), "--out", str(tmp_path / "back")]) == 0
    records = [step.record for step in DataSet.open(tmp_path / "back").episode("second").steps]
    assert [record.instruction for record in records] == ["put it there", "sweep", "put it there"]


@pytest.mark.parametrize(
    ("first", "second", "well"), [({"a": 0.1, "b": 0.2}, {"b": 0.3, "a": 0.4}, True), ({"a": 0.1}, {}, False)]
)
def test_joints_have_one_order_and_none_is_made_up(
    recorded: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str],
    first: dict[str, float], second: dict[str, float], well: bool,
) -> None:  # fmt: skip
    joints = iter([first, second, first, second, first])
    read = Step.observation
    monkeypatch.setattr(Step, "observation", lambda step: replace(read(step), joint_positions=next(joints)))
    assert main(["--from-bags", str(recorded), "--out", str(tmp_path / "out")]) == (0 if well else 1)
    if well:
        states = pq.read_table(tmp_path / "out" / form.DATA.format(0))[form.STATE].to_pylist()
        np.testing.assert_allclose(states[:2], [[0.1, 0.2], [0.4, 0.3]], rtol=1e-6)
    else:
        assert "episode first has the joints none, those before it a: " in capsys.readouterr().err


def _lose(path: str) -> Callable[[Path], None]:
    return lambda folder: (folder / path).unlink()


def _forget_a_row(folder: Path) -> None:
    table = pq.read_table(folder / form.DATA.format(0))
    pq.write_table(table.slice(1), folder / form.DATA.format(0))


def _break(folder: Path) -> None:
    (folder / form.STEPS).write_bytes(b"PAR1 and no more")


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (_lose(form.INFO), "is no data set of LeRobot: it has no meta/info.json"),
        (_lose(form.SETUP), "only what was written here knows camera, depth and boxes"),
        (_lose(form.TASKS), "lerobot cannot be read: "),
        (_lose(form.DATA.format(0)), "the files of data end before episode 0"),
        (_lose(form.STEPS), "steps.parquet"),
        (_forget_a_row, "episode first has 1 rows in data and 2 in cliport/steps.parquet"),
        (_break, "cannot be read: "),
        (lambda folder: (folder / form.SETUP).write_text("{}"), "cannot be read: it lacks 'setup'"),
        (lambda folder: form.write_tasks(folder / form.TASKS, ["one"]), "cannot be read: it lacks 1"),
        (lambda folder: pq.write_table(pa.table({"task_index": [0]}), folder / form.TASKS), "lists no sentences"),
    ],
)
def test_a_damaged_folder_is_one_line(
    written: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], spoil: Callable[[Path], None], words: str
) -> None:
    spoil(written)
    assert main(["--to-bags", str(written), "--out", str(tmp_path / "back")]) == 1
    error = capsys.readouterr().err.splitlines()[-1]
    assert error.startswith("error: ") and words in error
    assert not (tmp_path / "back").exists() and not list(tmp_path.glob(".back*"))


def test_what_cannot_be_written_is_one_line(
    make_episode: MakeEpisode, recorded: Path, written: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["--from-bags", str(recorded), "--out", str(written)]) == 1
    assert f"error: {written} exists: give another --out" in capsys.readouterr().err
    setup = replace(DataSet.open(recorded).setup, base_frame="elsewhere")
    make_episode(tmp_path / "other", "third", setup=setup)
    assert main(["--from-bags", str(recorded), str(tmp_path / "other"), "--out", str(tmp_path / "new")]) == 1
    assert "episode third was recorded with another set-up (base_frame 'base' here" in capsys.readouterr().err
    assert not (tmp_path / "new").exists()
