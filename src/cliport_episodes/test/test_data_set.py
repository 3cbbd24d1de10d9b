"""Listing and editing a data set."""

from __future__ import annotations

import errno
import json
import os
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
from rosbags.rosbag2 import Reader

from cliport_episodes.bag_metadata import read_custom_data
from cliport_episodes.capture_setup import CaptureSetup
from cliport_episodes.data_set import DataSet
from cliport_episodes.episode_folder import change_edits
from cliport_episodes.errors import (
    BadNameError,
    DataSetError,
    DiskFullError,
    EpisodeError,
    InstructionError,
    SetupDiffersError,
)
from cliport_episodes.writer import EpisodeWriter

Add = Callable[..., str]


def raw_files(data_set: DataSet) -> dict[str, bytes]:
    return {str(path.relative_to(data_set.path)): path.read_bytes() for path in data_set.path.rglob("*.mcap")}


def test_a_list_says_what_is_there(data_set: DataSet, add_episode: Add) -> None:
    assert data_set.episodes() == []
    add_episode(data_set.path, 2, "b", None)
    add_episode(data_set.path, 1, "a", False, instruction="sweep")
    first, second = DataSet.open(data_set.path).episodes()
    assert (first.name, first.n_steps, first.success, first.instructions) == ("a", 1, False, ("sweep",))
    assert (second.n_steps, second.success, second.finished, second.complaints) == (2, None, True, ())
    files = (data_set.path / "episodes" / "b").glob("[!.]*")
    assert second.bytes == sum(file.stat().st_size for file in files)


def test_the_index_is_made_anew_whenever_it_is_wrong(data_set: DataSet, add_episode: Add) -> None:
    add_episode(data_set.path, 2, "a")
    add_episode(data_set.path, 1, "b")
    true = data_set.episodes()
    index = data_set.path / "index.json"
    content = index.read_text()
    entry = json.loads(content)["episodes"]["a"]
    wrong = [
        "",
        "[]",
        "\udcff",
        content[: len(content) // 2],
        content.replace('"format": 1', '"format": 2'),
        content.replace('"pick_rotation": 3', '"pick_rotation": 99'),
        json.dumps({"format": 1, "episodes": {"a": entry, "ghost": entry}}),
        json.dumps({"format": 1, "episodes": {"a": {"files": "step_000.mcap:1:1"}}}),
    ]
    for text in wrong:
        index.write_bytes(text.encode("utf-8", "surrogateescape"))
        assert data_set.episodes() == true, text[:60]
        assert index.read_text() == content
    index.unlink()
    assert data_set.episodes() == true == data_set.rebuild_index()


def test_the_index_follows_the_bags(data_set: DataSet, add_episode: Add) -> None:
    add_episode(data_set.path, 2, "a")
    add_episode(data_set.path, 2, "b")
    data_set.episodes()
    file = data_set.path / "episodes" / "a" / "step_001.mcap"
    file.write_bytes(file.read_bytes()[:2000])
    shutil.rmtree(data_set.path / "episodes" / "b")
    (info,) = data_set.episodes()
    assert info.n_steps == 1 and "step_001" in info.complaints[0]


def test_edits_touch_no_raw_file(data_set: DataSet, add_episode: Add) -> None:
    name = add_episode(data_set.path, 3)
    before = raw_files(data_set)
    data_set.relabel(name, "  first all ")
    data_set.relabel(name, "把它放下", step=1)
    data_set.mark(name, False)
    data_set.trim(name, 1, None)
    episode = data_set.episode(name)
    assert [(s.record.step, s.record.instruction) for s in episode.steps] == [(1, "把它放下"), (2, "first all")]
    assert episode.success is False and episode.final is not None and episode.complaints == ()
    assert data_set.episodes()[0].instructions == ("把它放下", "first all")
    assert raw_files(data_set) == before
    data_set.trim(name, None, None)
    data_set.mark(name, None)
    assert len(data_set.episode(name).steps) == 3 and data_set.episode(name).success is None
    with Reader(data_set.path / "episodes" / name) as reader:
        assert len(list(reader.messages())) == reader.message_count == 3 * 9 + 5
        assert json.loads(reader.storage.metadata.custom["instructions"])["1"] == "把它放下"


def test_what_follows_the_last_step_left_is_the_final_scene(data_set: DataSet, add_episode: Add) -> None:
    name = add_episode(data_set.path, 3)
    data_set.trim(name, 0, 1)
    assert [step.record.step for step in data_set.episode(name).steps] == [0, 1]
    final = data_set.episode(name).final
    assert final is not None and final.joint_positions["panda_joint1"] == pytest.approx(0.2)


@pytest.mark.parametrize("last", [1, 100_000])
def test_a_trim_that_cuts_nothing_off_lets_the_episode_go_on(data_set: DataSet, add_episode: Add, last: int) -> None:
    name = add_episode(data_set.path, 2)
    data_set.trim(name, 0, last)
    folder = data_set.path / "episodes" / name
    assert {"first", "last"}.isdisjoint(read_custom_data(folder))
    EpisodeWriter.resume(folder).close()
    change_edits(folder, lambda edits: replace(edits, last=last), data_set.setup)  # as earlier versions left it
    EpisodeWriter.resume(folder).close()
    assert "last" not in read_custom_data(folder)
    data_set.trim(name, None, 0)
    with pytest.raises(EpisodeError, match="trimmed at its end"):
        EpisodeWriter.resume(folder)


def test_an_edit_is_whole_or_not_at_all(data_set: DataSet, add_episode: Add, monkeypatch: pytest.MonkeyPatch) -> None:
    name = add_episode(data_set.path, 1)
    metadata = data_set.path / "episodes" / name / "metadata.yaml"
    before = metadata.read_bytes()

    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, "full")

    for call in ("replace", "fsync"):
        with monkeypatch.context() as patch:
            patch.setattr(os, call, full)
            with pytest.raises(DiskFullError):
                data_set.mark(name, False)
        assert metadata.read_bytes() == before and data_set.episode(name).success is True
    assert {path.name for path in metadata.parent.glob("[!.]*")} == {"metadata.yaml", "step_000.mcap", "final.mcap"}


def test_edits_that_make_no_sense_are_refused_in_words(data_set: DataSet, add_episode: Add) -> None:
    name = add_episode(data_set.path, 2)
    with pytest.raises(EpisodeError, match=r"no step 2: it has 0\.\.1"):
        data_set.relabel(name, "x", step=2)
    with pytest.raises(InstructionError):
        data_set.relabel(name, "")
    for first, last in ((2, None), (1, 0), (None, -1)):
        with pytest.raises(EpisodeError, match=r"leave no step: it has 0\.\.1"):
            data_set.trim(name, first, last)
    with pytest.raises(EpisodeError, match="no episode 'other' in data set 'blocks'"):
        data_set.mark("other", True)


@pytest.mark.parametrize("name", ["..", "../blocks", "a/b", "/tmp", ".hidden", ""])
def test_no_name_leads_out_of_the_data_set(data_set: DataSet, setup: CaptureSetup, tmp_path: Path, name: str) -> None:
    for attempt in (data_set.episode, data_set.delete, data_set.restore, lambda n: data_set.mark(n, True)):
        with pytest.raises(BadNameError):
            attempt(name)
    with pytest.raises(BadNameError):
        DataSet.create(tmp_path / "x" / f".{name}" / "..", setup)


def test_the_trash_gives_back_until_it_is_emptied(data_set: DataSet, add_episode: Add) -> None:
    add_episode(data_set.path, 1, "a")
    before = raw_files(data_set)
    data_set.delete("a")
    assert data_set.episodes() == [] and data_set.trashed() == ["a"]
    data_set.restore("a")
    assert raw_files(data_set) == before and data_set.trashed() == []
    data_set.delete("a")
    add_episode(data_set.path, 2, "a")
    with pytest.raises(EpisodeError, match="another episode 'a'"):
        data_set.restore("a")
    data_set.delete("a")
    assert data_set.trashed() == ["a", "a-2"]
    assert data_set.empty_trash() == 2 and data_set.trashed() == []
    with pytest.raises(EpisodeError, match="in the trash"):
        data_set.restore("a")


def test_merging_keeps_both(data_set: DataSet, setup: CaptureSetup, add_episode: Add, tmp_path: Path) -> None:
    other = DataSet.create(tmp_path / "other", setup)
    add_episode(data_set.path, 1, "a")
    add_episode(other.path, 2, "a", instruction="push it")
    add_episode(other.path, 1, "b", False)
    theirs = raw_files(other)
    assert data_set.merge(other.path) == (("a-2", "b"), (), (), 2)
    assert [(e.name, e.n_steps) for e in data_set.episodes()] == [("a", 1), ("a-2", 2), ("b", 1)]
    assert data_set.episode("b").success is False
    data_set.mark("b", True)
    assert other.episode("b").success is False and raw_files(other) == theirs


def test_merging_keeps_what_differs_though_it_has_the_same_name_and_steps(
    data_set: DataSet, setup: CaptureSetup, add_episode: Add, tmp_path: Path
) -> None:
    other = DataSet.create(tmp_path / "other", setup)
    add_episode(data_set.path, 2, "a", instruction="to the left")
    add_episode(other.path, 2, "a", instruction="to the right")
    assert data_set.merge(other.path).added == ("a-2",)
    assert [e.instructions[0] for e in data_set.episodes()] == ["to the left", "to the right"]
    assert data_set.merge(other.path).added == ()  # it is here already, by its other name


def test_merging_again_adds_nothing(data_set: DataSet, setup: CaptureSetup, add_episode: Add, tmp_path: Path) -> None:
    other = DataSet.create(tmp_path / "other", setup)
    add_episode(other.path, 1, "a")
    assert data_set.merge(other.path) == (("a",), (), (), 1)
    assert data_set.merge(other.path).added == ()
    with pytest.raises(DataSetError, match="itself"):
        data_set.merge(data_set.path / ".." / data_set.name)


def test_data_of_another_setup_is_not_mixed(data_set: DataSet, setup: CaptureSetup, tmp_path: Path) -> None:
    moved = replace(setup, camera=replace(setup.camera, fx=70.0))
    DataSet.create(tmp_path / "other", moved)
    for attempt in (
        lambda: data_set.merge(tmp_path / "other"),
        lambda: DataSet.open_or_create(tmp_path / "other", setup),
    ):
        with pytest.raises(SetupDiffersError, match="camera fx") as caught:
            attempt()
        assert len(caught.value.differences) == 1
    assert DataSet.open_or_create(data_set.path, setup).path == data_set.path
    assert DataSet.open_or_create(tmp_path / "new", setup).episodes() == []


def test_splitting_deals_out_each_episode_once(data_set: DataSet, add_episode: Add) -> None:
    names = {add_episode(data_set.path, 1, f"e{n}") for n in range(5)}
    parts = data_set.split([("train", 0.8), ("val", 0.2)], seed=3)
    dealt = {part: {info.name for info in made.episodes()} for part, made in parts.items()}
    assert [len(dealt["train"]), len(dealt["val"])] == [4, 1] and dealt["train"] | dealt["val"] == names
    assert parts["train"].path == data_set.path.with_name("blocks_train")
    assert parts["val"].episode(dealt["val"].pop()).steps[0].observation().color.any()
    assert len(data_set.episodes()) == 5
    with pytest.raises(DataSetError, match="'blocks_train' exists"):
        data_set.split([("train", 1)], seed=3)
    again = data_set.split([("few", 2), ("rest", 2)], seed=3)
    assert [len(made.episodes()) for made in again.values()] == [2, 2]
    twice = [("x", 0.8), ("x", 0.2)]
    for parts_wanted in ([("x", 6.0)], [("x", 0.9), ("y", 0.2)], [("x", -0.1)], [("x", 0.001)], [], twice):
        with pytest.raises(DataSetError):
            data_set.split(parts_wanted, seed=0)


def test_the_seed_decides_who_gets_which_episode(data_set: DataSet, add_episode: Add) -> None:
    for n in range(6):
        add_episode(data_set.path, 1, f"e{n}")

    def dealt(seed: int, part: str) -> frozenset[str]:
        parts = data_set.split([(part, 3)], seed)
        return frozenset(info.name for info in parts[part].episodes())

    by_seed = [dealt(seed, f"seed{seed}") for seed in range(6)]
    assert [dealt(seed, f"again{seed}") for seed in range(6)] == by_seed
    assert len(set(by_seed)) > 2


def test_a_folder_that_is_none_is_refused(tmp_path: Path, setup: CaptureSetup) -> None:
    with pytest.raises(DataSetError, match=r"no dataset\.yaml"):
        DataSet.open(tmp_path)
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "thesis.tex").write_text("x")
    with pytest.raises(DataSetError, match="not an empty folder"):
        DataSet.create(tmp_path / "full", setup)
    for content in ("format: 9", "format: 1\nworkspace: 3", "{", "", "format: 1\ncamera: [1]"):
        (tmp_path / "full" / "dataset.yaml").write_text(content)
        with pytest.raises(DataSetError):
            DataSet.open(tmp_path / "full")


def test_a_data_set_can_be_moved(
    data_set: DataSet, add_episode: Add, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    name = add_episode(data_set.path, 1)
    data_set.path.rename(tmp_path / "elsewhere")
    monkeypatch.chdir(tmp_path / "elsewhere")
    moved = DataSet.open(Path("."))
    assert moved.name == "elsewhere" and moved.episodes()[0].name == name
    moved.mark(name, False)
    assert str(tmp_path) not in (tmp_path / "elsewhere" / "index.json").read_text()
    assert list(moved.split([("all", 1.0)], 0)["all"].episodes())
