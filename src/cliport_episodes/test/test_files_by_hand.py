"""What lies on the disk, to the last value and in the order in which it got there."""

from __future__ import annotations

import errno
import fcntl
import os
import re
from collections.abc import Callable
from dataclasses import replace
from datetime import datetime
from pathlib import Path
from typing import Any

import pytest
import yaml

from cliport_core import whole_file
from cliport_episodes import disk, episode_folder, writer
from cliport_episodes.bag_file import BagFile, BagTopic, describe, is_latched, write_bag_file
from cliport_episodes.bag_metadata import read_custom_data, write_metadata
from cliport_episodes.checks import check_episode
from cliport_episodes.data_set import DataSet
from cliport_episodes.demonstration import StepRecord
from cliport_episodes.episode_folder import FolderLock, new_name, next_undone_path, step_name, step_paths, undone_paths
from cliport_episodes.errors import BadNameError, BagError, DiskFullError, EpisodeBusyError, EpisodeError
from cliport_episodes.names import check_name
from cliport_episodes.raw import RawMessage
from cliport_episodes.reader import read_episode, read_steps
from cliport_episodes.summary import EpisodeIndex
from cliport_episodes.writer import EpisodeWriter

Scene = Callable[[int], list[RawMessage]]


def test_metadata_of_two_files(tmp_path: Path) -> None:
    a = BagTopic("/a", "std_msgs/msg/String", "RIHS01_1", (), 2)
    b = BagTopic("/b", "std_msgs/msg/Empty", "RIHS01_2", (), 5)
    first = BagFile("step_000.mcap", 100, 180, (b, a))
    second = BagFile("final.mcap", 200, 260, (replace(a, count=4),))
    write_metadata(tmp_path, [first, second], {"success": "true", "notes": "ä"})
    document = yaml.safe_load((tmp_path / "metadata.yaml").read_text(encoding="utf-8"))

    def topic(name: str, kind: str, digest: str, count: int) -> dict[str, Any]:
        told = {"name": name, "type": kind, "serialization_format": "cdr", "offered_qos_profiles": []}
        return {"topic_metadata": {**told, "type_description_hash": digest}, "message_count": count}

    def file(name: str, start: int, duration: int, count: int) -> dict[str, Any]:
        return {
            "path": name, "starting_time": {"nanoseconds_since_epoch": start}, "duration": {"nanoseconds": duration},
            "message_count": count,
        }  # fmt: skip

    assert document == {
        "rosbag2_bagfile_information": {
            "version": 9, "storage_identifier": "mcap", "duration": {"nanoseconds": 160},
            "starting_time": {"nanoseconds_since_epoch": 100}, "message_count": 11,
            "topics_with_message_count": [
                topic("/a", "std_msgs/msg/String", "RIHS01_1", 6), topic("/b", "std_msgs/msg/Empty", "RIHS01_2", 5),
            ],
            "compression_format": "", "compression_mode": "",
            "relative_file_paths": ["step_000.mcap", "final.mcap"],
            "files": [file("step_000.mcap", 100, 80, 7), file("final.mcap", 200, 60, 4)],
            "custom_data": {"success": "true", "notes": "ä"}, "ros_distro": "jazzy",
        }
    }  # fmt: skip
    assert "ä" in (tmp_path / "metadata.yaml").read_text(encoding="utf-8")
    assert read_custom_data(tmp_path) == {"success": "true", "notes": "ä"}
    write_metadata(tmp_path, [], {})
    assert read_custom_data(tmp_path) == {}
    (tmp_path / "metadata.yaml").unlink()
    with pytest.raises(BagError, match=r"^metadata.yaml is missing$"):
        read_custom_data(tmp_path)


def test_a_file_is_described_as_it_was_written(tmp_path: Path, scene: Scene) -> None:
    messages = sorted(scene(0), key=lambda message: message.stamp_ns)
    written = write_bag_file(tmp_path / "step_000.mcap", messages)
    assert written == describe(tmp_path / "step_000.mcap") and written.count == 5
    assert (written.start_ns, written.end_ns) == (messages[0].stamp_ns, messages[-1].stamp_ns)
    assert {topic.name: len(topic.offers) for topic in written.topics if topic.offers} == {"/tf_static": 1}
    assert [path.name for path in tmp_path.iterdir()] == ["step_000.mcap"]
    assert is_latched("/tf_static") and not is_latched("/tf")


def test_names_of_files_and_folders(tmp_path: Path) -> None:
    assert re.fullmatch(r"20260102-030405-[0-9a-f]{4}", new_name(datetime(2026, 1, 2, 3, 4, 5)))
    assert (step_name(7), step_name(1234)) == ("step_007.mcap", "step_1234.mcap")
    good = ("step_000.mcap", "step_010.mcap", "step_009.mcap", "step_123456789.mcap")
    for name in (*good, "step_12.mcap", "step_1234567890.mcap", "xstep_001.mcap", "step_001.mcap.new", "final.mcap"):
        (tmp_path / name).touch()
    assert [(n, path.name) for n, path in step_paths(tmp_path).items()] == [
        (0, "step_000.mcap"), (9, "step_009.mcap"), (10, "step_010.mcap"), (123456789, "step_123456789.mcap"),
    ]  # fmt: skip
    for nothing in (tmp_path / "gone", tmp_path / "final.mcap"):
        with pytest.raises(EpisodeError, match=f"there is no episode '{nothing.name}'"):
            step_paths(nothing)
    assert check_name("x", "a" * 100)
    with pytest.raises(BadNameError, match="'" + "a" * 80 + "' cannot be used: 1 to 100 of"):
        check_name("x", "a" * 101)


def test_undone_steps_are_numbered_from_one(tmp_path: Path) -> None:
    folder = tmp_path / "episodes" / "e"
    place = tmp_path / "undone" / "e"
    assert next_undone_path(folder, 3) == place / "step_003.1.mcap"
    place.mkdir(parents=True)
    for name in ("step_003.9.mcap", "step_003.10.mcap", "step_003.2.mcap", "step_004.77.mcap"):
        (place / name).touch()
    assert [path.name.split(".")[1] for path in undone_paths(folder, 3)] == ["2", "9", "10"]
    assert next_undone_path(folder, 3).name == "step_003.11.mcap"
    assert episode_folder.unused_path(place, "new") == place / "new"
    for name in ("new", "new-2"):
        (place / name).touch()
    assert episode_folder.unused_path(place, "new") == place / "new-3"


def test_a_lock_is_of_a_folder_and_says_why_not(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "file").touch()
    for name in ("gone", "file"):
        with pytest.raises(EpisodeError, match=f"there is no episode '{name}'"):
            FolderLock(tmp_path / name)
    lock = FolderLock(tmp_path)
    with pytest.raises(EpisodeBusyError):
        FolderLock(tmp_path)
    lock.release()
    lock.release()
    FolderLock(tmp_path).release()
    open_before = len(os.listdir("/proc/self/fd"))
    disk.sync(tmp_path)  # which leaves no file open, too

    def refuse(*_: object) -> None:
        raise OSError(errno.ENOLCK, "No locks available")

    monkeypatch.setattr(fcntl, "flock", refuse)
    with pytest.raises(
        EpisodeError,
        match=r"cannot be locked against other programs \(No locks available\): keep the data set on a local",
    ):
        FolderLock(tmp_path)
    assert len(os.listdir("/proc/self/fd")) == open_before


@pytest.fixture
def synced(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Names of what was brought to the disk."""
    found: list[str] = []

    def sync(path: Path) -> None:
        if path.suffix != whole_file.UNFINISHED:
            found.append(path.name)

    for module in (disk, writer, whole_file):
        monkeypatch.setattr(module, "sync", sync)
    return found


def test_folders_are_on_the_disk_before_what_they_hold(
    data_set: DataSet, synced: list[str], scene: Scene, record: StepRecord
) -> None:
    made = EpisodeWriter.create(data_set.path, data_set.setup, "mine")
    assert synced[:2] == ["episodes", "blocks"]
    made.add_step(scene(0), record)
    synced.clear()
    made.undo_step()
    assert synced == ["undone", "blocks", "mine", "mine", "mine"]  # its folder, metadata.yaml, then both ends
    made.close()
    for attempt in (made.undo_step, made.restore_step, made.discard):
        with pytest.raises(EpisodeError):
            attempt()
    assert not made.restorable()


def test_a_name_that_is_taken_is_refused(data_set: DataSet, add_episode: Callable[..., str]) -> None:
    add_episode(data_set.path, 1, "mine")
    with pytest.raises(EpisodeError, match=r"^episode 'mine' exists: choose another name$"):
        EpisodeWriter.create(data_set.path, data_set.setup, "mine")
    assert data_set.episode("mine").finished


def test_a_step_that_cannot_come_back_stays_undone(
    data_set: DataSet, scene: Scene, record: StepRecord, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = EpisodeWriter.create(data_set.path, data_set.setup, "mine")
    made.add_step(scene(0), record)

    def refuse(*_: object) -> None:
        raise OSError(errno.ENOSPC, "full")

    for attempt, steps in ((made.undo_step, 1), (made.restore_step, 0)):
        with monkeypatch.context() as patched:
            patched.setattr(writer, "write_metadata", refuse)
            with pytest.raises(DiskFullError):
                attempt()
        assert made.n_steps == len(step_paths(made.path)) == steps and data_set.undone_steps() == 1 - steps
        if steps:
            made.undo_step()
    assert made.restore_step().instruction == record.instruction


def test_a_renamed_file_is_on_the_disk_at_both_ends(tmp_path: Path, synced: list[str]) -> None:
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
    (tmp_path / "a" / "x").touch()
    disk.move(tmp_path / "a" / "x", tmp_path / "b" / "y")
    assert synced == ["b", "a"] and (tmp_path / "b" / "y").exists()
    disk.move(tmp_path / "b" / "y", tmp_path / "b" / "z")
    assert synced == ["b", "a", "b"]
    disk.replace_text(tmp_path / "b" / "z", "ä")
    assert synced[3:] == ["b"] and (tmp_path / "b" / "z").read_bytes() == "ä".encode()
    assert [path.name for path in (tmp_path / "b").iterdir()] == ["z"]


def test_only_what_was_trimmed_off_is_not_read(data_set: DataSet, add_episode: Callable[..., str]) -> None:
    """Also where something is kept behind it."""
    name = add_episode(data_set.path, 3)
    folder = data_set.path / "episodes" / name
    data_set.trim(name, 1, None)
    assert [record.step for record in read_steps(folder).records] == [1, 2]
    with pytest.raises(EpisodeError, match=r"has no step -1: it has 0\.\.2"):
        data_set.trim(name, -1, 1)


def test_what_was_undone_is_kept_until_the_trash_is_emptied(
    data_set: DataSet, scene: Scene, record: StepRecord
) -> None:
    made = EpisodeWriter.create(data_set.path, data_set.setup)
    for moment in range(2):
        made.add_step(scene(moment), record)
    made.undo_step()
    made.undo_step()
    made.close()
    (data_set.path / "trash").mkdir()
    (data_set.path / "trash" / ".hidden").mkdir()
    assert data_set.undone_steps() == 2 and data_set.trashed() == []
    assert data_set.empty_trash() == 0 and data_set.undone_steps() == 0
    assert (data_set.path / "trash" / ".hidden").is_dir()


def test_messages_before_the_last_step_are_moved_to_its_end(
    data_set: DataSet, scene: Scene, record: StepRecord
) -> None:
    """Time never goes back; transforms are logged when the step begins, however old they are."""
    made = EpisodeWriter.create(data_set.path, data_set.setup)
    made.add_step(scene(1), record)
    end = made._end_ns
    made.add_step([replace(message, stamp_ns=message.stamp_ns - 5) for message in scene(0)], record)
    file = describe(made.path / "step_001.mcap")
    assert file.start_ns == file.end_ns == end
    made.add_step([], record)
    assert describe(made.path / "step_002.mcap").start_ns == end
    made.close()
    fresh = EpisodeWriter.create(data_set.path, data_set.setup)
    fresh.add_step([], record)  # nothing was seen: the time of its images
    assert describe(fresh.path / "step_000.mcap").start_ns == record.stamp_ns
    assert fresh._in_order([]) == []


@pytest.mark.parametrize(
    ("values", "said"),
    [({"success": True, "finished": True}, []), ({"finished": False}, ["it was not finished: resume it, or mark"])],
)
def test_defects_of_an_episode(
    data_set: DataSet, add_episode: Callable[..., str], values: dict[str, Any], said: list[str]
) -> None:
    episode = replace(data_set.episode(add_episode(data_set.path, 1)), **values)
    found = check_episode(episode, data_set.setup)
    assert len(found) == len(said) and all(line.startswith(words) for line, words in zip(found, said, strict=True))
    other = replace(data_set.setup, base_frame="elsewhere")
    words = "it was recorded with another setup: base_frame 'panda_link0' here, 'elsewhere' there"
    assert check_episode(episode, other)[-1] == words
    far = replace(data_set.setup.workspace, x_min=5.25, x_max=5.65)
    assert "step 0 shows nothing of the workspace" in check_episode(episode, replace(data_set.setup, workspace=far))


def test_a_bag_that_lost_messages_says_so(data_set: DataSet, add_episode: Callable[..., str]) -> None:
    name = add_episode(data_set.path, 1)
    path = data_set.path / "episodes" / name / "metadata.yaml"
    path.write_text(path.read_text().replace("message_count: 14", "message_count: 15"))
    found = check_episode(data_set.episode(name), data_set.setup)
    assert found == ["it holds 14 messages and says 15"]
    path.unlink()
    assert check_episode(read_episode(path.parent), data_set.setup)[-1].startswith("as a rosbag2 bag it cannot be read")


def test_the_index_is_written_only_when_something_changed(
    data_set: DataSet, add_episode: Callable[..., str], monkeypatch: pytest.MonkeyPatch
) -> None:
    add_episode(data_set.path, 1)
    data_set.episodes()
    monkeypatch.setattr(EpisodeIndex, "_store", lambda *_: pytest.fail("nothing has changed"))
    monkeypatch.setattr("cliport_episodes.summary._read", lambda _: pytest.fail("it is in the index"))
    (info,) = data_set.episodes()
    assert info.n_steps == 1


def test_an_index_made_anew_forgets_what_it_said(data_set: DataSet, add_episode: Callable[..., str]) -> None:
    add_episode(data_set.path, 1)
    data_set.episodes()
    index = data_set.path / "index.json"
    index.write_text(index.read_text().replace("put the red block", "put the blue block"))
    said = [info.instructions[0] for info in (*data_set.episodes(), *data_set.rebuild_index())]
    assert said == ["put the blue block in the green bowl", "put the red block in the green bowl"]
    (data_set.path.parent / "empty").mkdir()
    assert DataSet.create(data_set.path.parent / "empty", data_set.setup).episodes() == []
