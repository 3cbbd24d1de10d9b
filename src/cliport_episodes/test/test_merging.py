"""Copies of episodes that went on, or were edited, elsewhere; edits of later versions; a lost dataset.yaml; locks."""

from __future__ import annotations

import errno
import fcntl
import os
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from cliport_episodes.bag_metadata import read_custom_data
from cliport_episodes.capture_setup import CaptureSetup
from cliport_episodes.data_set import DataSet
from cliport_episodes.demonstration import StepRecord
from cliport_episodes.edits import Edits
from cliport_episodes.episode_folder import FolderLock
from cliport_episodes.errors import DataSetError, EpisodeBusyError, EpisodeError
from cliport_episodes.raw import RawMessage
from cliport_episodes.reader import read_episode
from cliport_episodes.writer import EpisodeWriter

Add = Callable[..., str]
GoOn = Callable[[DataSet, str], None]


@pytest.fixture
def copied(data_set: DataSet, add_episode: Add, tmp_path: Path) -> DataSet:
    """A copy of a data set with episode 'a' of two steps."""
    add_episode(data_set.path, 2, "a")
    shutil.copytree(data_set.path, tmp_path / "copy")
    return DataSet.open(tmp_path / "copy")


@pytest.fixture
def go_on(scene: Callable[[int], list[RawMessage]], record: StepRecord) -> GoOn:
    """Adds a step to episode 'a' of a data set."""

    def add(data_set: DataSet, instruction: str) -> None:
        writer = EpisodeWriter.resume(data_set.path / "episodes" / "a")
        writer.add_step(scene(7), replace(record, instruction=instruction))
        writer.finish(scene(8), True)

    return add


def shown(data_set: DataSet) -> list[tuple[str, int, bool | None]]:
    return [(info.name, info.n_steps, info.success) for info in data_set.episodes()]


def test_a_copy_that_went_on_takes_the_place_of_the_original(data_set: DataSet, copied: DataSet, go_on: GoOn) -> None:
    go_on(copied, "push it")
    merged = data_set.merge(copied.path)
    assert merged == ((), ("a",), (), 1)
    assert (
        merged.words("copy")
        == "0 of the 1 episodes of copy are added; 1 went on or were edited there and are taken over: a"
    )
    assert shown(data_set) == [("a", 3, True)] and data_set.trashed() == ["a"]
    assert data_set.merge(copied.path) == ((), (), (), 1)
    assert copied.merge(data_set.path) == ((), (), (), 1)


def test_an_original_that_went_on_stays(data_set: DataSet, copied: DataSet, go_on: GoOn) -> None:
    go_on(data_set, "push it")
    assert data_set.merge(copied.path) == ((), (), (), 1)
    assert shown(data_set) == [("a", 3, True)] and data_set.trashed() == []


def test_where_both_went_on_the_one_here_stays_and_that_is_said(
    data_set: DataSet, copied: DataSet, go_on: GoOn
) -> None:
    go_on(data_set, "push it")
    go_on(copied, "pull it")
    merged = data_set.merge(copied.path)
    assert merged == ((), (), ("a",), 1)
    assert merged.words("copy").endswith("; 1 went on or were edited in both and stay as they are here: a")
    assert data_set.episode("a").steps[-1].record.instruction == "push it"


def test_labels_of_a_copy_that_the_other_outgrew_are_not_lost_in_silence(
    data_set: DataSet, copied: DataSet, go_on: GoOn
) -> None:
    copied.relabel("a", "tidy up", 1)
    go_on(data_set, "push it")
    assert data_set.merge(copied.path).forked == ("a",)
    assert copied.merge(data_set.path).forked == ("a",)
    assert shown(data_set) == [("a", 3, True)] and shown(copied) == [("a", 2, True)]
    data_set.mark("a", True)  # later than what was done there
    assert data_set.merge(copied.path) == ((), (), (), 1)
    assert copied.merge(data_set.path).updated == ("a",)
    assert shown(copied) == [("a", 3, True)]


def test_the_later_labels_win_and_nothing_else(data_set: DataSet, copied: DataSet) -> None:
    data_set.mark("a", False)
    copied.mark("a", None)
    copied.relabel("a", "tidy up", 1)
    assert data_set.merge(copied.path).updated == ("a",)
    assert [step.record.instruction for step in data_set.episode("a").steps][1] == "tidy up"
    assert data_set.episode("a").success is None
    data_set.mark("a", True)
    assert data_set.merge(copied.path) == ((), (), (), 1)
    assert data_set.episode("a").success is True and data_set.trashed() == []


def test_edits_of_a_later_version_are_not_written_over(data_set: DataSet, copied: DataSet) -> None:
    metadata = data_set.path / "episodes/a/metadata.yaml"
    metadata.write_text(metadata.read_text().replace("cliport_format: '1'", "cliport_format: '2'"))
    before = metadata.read_bytes()
    for change in (
        lambda: data_set.mark("a", False),
        lambda: data_set.relabel("a", "push it"),
        lambda: EpisodeWriter.resume(metadata.parent),
    ):
        with pytest.raises(EpisodeError, match="is not changed: it has format 2, and 1 is known here: update this"):
            change()
    assert metadata.read_bytes() == before
    assert len(data_set.episode("a").steps) == 2, "it can still be read"
    copied.mark("a", False)
    with pytest.raises(EpisodeError, match="is not changed"):
        data_set.merge(copied.path)


def test_damaged_edits_are_kept_beside_the_new_ones(data_set: DataSet, add_episode: Add) -> None:
    folder = data_set.path / "episodes" / add_episode(data_set.path, 2)
    metadata = folder / "metadata.yaml"
    torn = [metadata.read_bytes()[:300], metadata.read_bytes()[:200]]
    for content in torn:
        metadata.write_bytes(content)
        data_set.mark(folder.name, False)
        assert data_set.episode(folder.name).success is False
    kept = [folder / "metadata.yaml.unreadable", folder / "metadata.yaml.unreadable-2"]
    assert [path.read_bytes() for path in kept] == torn


def test_what_a_later_version_added_to_the_edits_is_kept(data_set: DataSet, add_episode: Add) -> None:
    name = add_episode(data_set.path, 1)
    folder = data_set.path / "episodes" / name
    metadata = folder / "metadata.yaml"
    metadata.write_text(metadata.read_text().replace("cliport_format:", "rating: five stars\n    cliport_format:"))
    data_set.mark(name, False)
    kept = read_custom_data(folder)
    assert (kept["rating"], kept["success"]) == ("five stars", "false") and int(kept["edited_ns"]) > 1e18
    assert Edits.from_custom_data(kept).others == {"rating": "five stars"}
    writer = EpisodeWriter.resume(folder)
    writer.close()
    assert read_custom_data(folder)["rating"] == "five stars"


def test_a_lost_data_set_file_is_made_again(data_set: DataSet, add_episode: Add, setup: CaptureSetup) -> None:
    add_episode(data_set.path, 1, "a")
    (data_set.path / "dataset.yaml").unlink()
    for open_it in (lambda: DataSet.open(data_set.path), lambda: DataSet.open_or_create(data_set.path, setup)):
        found = open_it()
        assert found.setup.differences(setup) == [] and shown(found) == [("a", 1, True)]
        assert (data_set.path / "dataset.yaml").is_file()


def test_a_lost_data_set_file_is_not_guessed(
    data_set: DataSet, add_episode: Add, setup: CaptureSetup, tmp_path: Path
) -> None:
    add_episode(data_set.path, 1, "a")
    moved = DataSet.create(tmp_path / "moved", replace(setup, camera=replace(setup.camera, fx=70.0)))
    other = EpisodeWriter.create(moved.path, moved.setup, "b")
    other.close()
    shutil.copytree(other.path, data_set.path / "episodes/b")
    (data_set.path / "dataset.yaml").unlink()
    with pytest.raises(DataSetError, match=r"episodes 'a' and 'b' are not of one setup .*camera fx"):
        DataSet.open(data_set.path)
    (tmp_path / "empty").mkdir()
    with pytest.raises(DataSetError, match=r"it has no dataset\.yaml"):
        DataSet.open(tmp_path / "empty")


def test_an_episode_whose_steps_cannot_be_read_just_now_is_not_removed(data_set: DataSet, add_episode: Add) -> None:
    name = add_episode(data_set.path, 1)
    step = data_set.path / "episodes" / name / "step_000.mcap"
    whole = step.read_bytes()
    step.write_bytes(whole[:100])
    writer = EpisodeWriter.resume(step.parent)
    writer.discard()
    assert data_set.trashed() == [name]
    (data_set.path / "trash" / name / step.name).write_bytes(whole)
    data_set.restore(name)
    assert len(read_episode(step.parent).steps) == 1


def test_on_a_file_system_without_locks_nothing_is_written(
    data_set: DataSet, add_episode: Add, monkeypatch: pytest.MonkeyPatch
) -> None:
    name = add_episode(data_set.path, 1)
    before = (data_set.path / "episodes" / name / "metadata.yaml").read_bytes()
    monkeypatch.setattr(fcntl, "flock", _raise_no_locks)
    with pytest.raises(EpisodeError, match=r"cannot be locked against other programs .*network one that has locks"):
        data_set.mark(name, False)
    assert (data_set.path / "episodes" / name / "metadata.yaml").read_bytes() == before


@pytest.mark.parametrize("number", [errno.EROFS, errno.EACCES, errno.ENOSPC])
def test_where_no_file_can_be_made_the_folder_itself_is_locked(
    data_set: DataSet, add_episode: Add, monkeypatch: pytest.MonkeyPatch, number: int
) -> None:
    """As the source of a merge is, on a disk that is read only."""
    folder = data_set.path / "episodes" / add_episode(data_set.path, 1)
    (folder / ".lock").unlink()
    opened = os.open

    def refuse(path: Path, *arguments: int) -> int:
        if Path(path).name == ".lock":
            raise OSError(number, os.strerror(number))
        return opened(path, *arguments)

    monkeypatch.setattr(os, "open", refuse)
    lock = FolderLock(folder)
    with pytest.raises(EpisodeBusyError):
        FolderLock(folder)
    lock.release()
    FolderLock(folder).release()


def _raise_no_locks(*_: object) -> None:
    raise OSError(errno.ENOLCK, "No locks available")


def test_a_lock_excludes_others_until_it_is_given_back(data_set: DataSet, add_episode: Add) -> None:
    name = add_episode(data_set.path, 1)
    writer = EpisodeWriter.resume(data_set.path / "episodes" / name)
    with pytest.raises(EpisodeBusyError):
        data_set.mark(name, False)
    writer.close()
    data_set.mark(name, False)
    assert data_set.episode(name).success is False
