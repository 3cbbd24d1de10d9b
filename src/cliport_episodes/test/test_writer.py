"""What a recorder leaves on the disk."""

from __future__ import annotations

import errno
import multiprocessing
import os
import resource
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rosbags.interfaces import QosDurability
from rosbags.rosbag2 import Reader
from rosbags.rosbag2.storage_mcap import McapWriter

from cliport_core.whole_file import UNFINISHED
from cliport_episodes.bags import read_messages
from cliport_episodes.capture_setup import CaptureSetup
from cliport_episodes.data_set import DataSet
from cliport_episodes.demonstration import StepRecord
from cliport_episodes.episode_folder import FolderLock
from cliport_episodes.errors import (
    DataSetError,
    DiskError,
    DiskFullError,
    EpisodeBusyError,
    EpisodeError,
    InstructionError,
    SetupDiffersError,
)
from cliport_episodes.raw import RawMessage
from cliport_episodes.reader import read_episode
from cliport_episodes.writer import EpisodeWriter

Scene = Callable[[int], list[RawMessage]]


@pytest.fixture
def writer(data_set: DataSet, setup: CaptureSetup) -> EpisodeWriter:
    return EpisodeWriter.create(data_set.path, setup)


def test_the_plain_library_reads_all_in_the_order_of_time(data_set: DataSet, add_episode: Callable[..., str]) -> None:
    path = data_set.path / "episodes" / add_episode(data_set.path, n_steps=2)
    with Reader(path) as reader:
        messages = list(reader.messages())
        times = [time for _, time, _ in messages]
        assert times == sorted(times) and len(times) == reader.message_count == 2 * 9 + 5
        assert times[0] == reader.start_time and times[-1] == reader.end_time - 1
        assert reader.duration < 21e9, "transforms that were sent long before do not stretch the bag"
        offers = [(c.topic, offer.durability) for c in reader.connections for offer in c.ext.offered_qos_profiles]
        assert offers == [("/tf_static", QosDurability.TRANSIENT_LOCAL)]
        (offer,) = (offer for c in reader.connections for offer in c.ext.offered_qos_profiles)
        durations = {offer.deadline, offer.lifespan, offer.liveliness_lease_duration}
        assert {duration.sec * 10**9 + duration.nsec for duration in durations} == {2**63 - 1}  # rmw's "infinite"
        assert all(c.msgdef.data and c.digest.startswith("RIHS01_") for c in reader.connections)
        custom = reader.storage.metadata.custom
        assert (custom["cliport_format"], custom["success"]) == ("1", "true")


def test_bytes_come_back_as_they_were(writer: EpisodeWriter, scene: Scene, record: StepRecord) -> None:
    sent = scene(0)
    writer.add_step(sent, record)
    read = {message.topic: message for message in read_messages(writer.path)}
    for message in sent:
        assert read[message.topic].data == message.data and read[message.topic].type == message.type
        if message.topic != "/tf_static":
            assert read[message.topic].stamp_ns == message.stamp_ns


def test_steps_are_numbered_and_can_be_undone(writer: EpisodeWriter, scene: Scene, record: StepRecord) -> None:
    for moment in range(3):
        writer.add_step(scene(moment), replace(record, step=9, instruction=f"do {moment}"))
    before = (writer.path / "step_001.mcap").read_bytes()
    writer.undo_step()
    assert writer.n_steps == 2 and not (writer.path / "step_002.mcap").exists()
    assert (writer.path / "step_001.mcap").read_bytes() == before
    writer.add_step(scene(3), replace(record, instruction="do 3"))
    records = [step.record for step in read_episode(writer.path).steps]
    assert [(r.step, r.instruction) for r in records] == [(0, "do 0"), (1, "do 1"), (2, "do 3")]
    for _ in range(3):
        writer.undo_step()
    with pytest.raises(EpisodeError, match="no step to undo"):
        writer.undo_step()
    with pytest.raises(EpisodeError, match="discard"):
        writer.finish([], None)


def test_another_step_does_not_inherit_what_the_undone_one_was_called(
    writer: EpisodeWriter, data_set: DataSet, scene: Scene, record: StepRecord
) -> None:
    for moment in range(2):
        writer.add_step(scene(moment), replace(record, instruction=f"do {moment}"))
    writer.close()
    data_set.relabel(writer.name, "do it well", step=1)
    data_set.relabel(writer.name, "begin", step=0)
    resumed = EpisodeWriter.resume(writer.path)
    resumed.undo_step()
    resumed.add_step(scene(2), replace(record, instruction="do 2"))
    assert [step.record.instruction for step in read_episode(writer.path).steps] == ["begin", "do 2"]
    resumed.close()
    assert [step.record.instruction for step in read_episode(writer.path).steps] == ["begin", "do 2"]


def test_an_undone_step_comes_back_until_another_is_added(
    writer: EpisodeWriter, scene: Scene, record: StepRecord
) -> None:
    def texts() -> list[str]:
        return [step.record.instruction for step in read_episode(writer.path).steps]

    for moment in range(3):
        writer.add_step(scene(moment), replace(record, instruction=f"do {moment}"))
    whole = {path.name: path.read_bytes() for path in writer.path.glob("*.mcap")}
    assert not writer.restorable()
    writer.undo_step()
    writer.undo_step()
    writer.close()
    again = EpisodeWriter.resume(writer.path)
    for _ in range(2):
        assert again.restorable()
        again.restore_step()
    assert texts() == ["do 0", "do 1", "do 2"] and not again.restorable()
    assert {path.name: path.read_bytes() for path in writer.path.glob("*.mcap")} == whole
    with Reader(writer.path) as reader:
        assert reader.message_count == 3 * 9
    again.undo_step()
    again.undo_step()
    again.add_step(scene(3), replace(record, instruction="do 3"))
    with pytest.raises(EpisodeError, match="no step to bring back"):
        again.restore_step()  # it is older than the one that took its place
    again.undo_step()
    again.restore_step()
    assert texts() == ["do 0", "do 3"]


def test_a_finished_episode_says_how_it_ended(writer: EpisodeWriter, scene: Scene, record: StepRecord) -> None:
    writer.add_step(scene(0), record)
    unfinished = read_episode(writer.path)
    assert (unfinished.final, unfinished.finished, unfinished.complaints) == (None, False, ())
    writer.finish(scene(1), False)
    episode = read_episode(writer.path)
    assert (episode.success, episode.finished, episode.complaints) == (False, True, ())
    assert episode.final is not None and episode.final.joint_positions["panda_joint1"] == pytest.approx(0.1)
    with pytest.raises(EpisodeError, match="was ended"):
        writer.add_step(scene(2), record)


def test_an_episode_that_ends_anew_keeps_no_final_scene_of_before(
    writer: EpisodeWriter, scene: Scene, record: StepRecord
) -> None:
    writer.add_step(scene(0), record)
    writer.finish(scene(1), True)
    again = EpisodeWriter.resume(writer.path)
    again.finish((), False)
    episode = read_episode(writer.path)
    assert (episode.success, episode.finished, episode.final, episode.complaints) == (False, True, None, ())
    with pytest.raises(EpisodeError, match="was ended"):
        again.finish((), True)


def test_an_interrupted_episode_goes_on(writer: EpisodeWriter, scene: Scene, record: StepRecord) -> None:
    writer.add_step(scene(0), record)
    writer.close()
    (writer.path / ".writing").mkdir()
    resumed = EpisodeWriter.resume(writer.path)
    resumed.add_step(scene(1), record)
    resumed.finish(scene(2), True)
    again = EpisodeWriter.resume(writer.path)
    assert again.n_steps == 2 and read_episode(writer.path).final is not None
    again.add_step(scene(3), record)
    episode = read_episode(writer.path)
    assert len(episode.steps) == 3 and episode.final is None and not episode.finished
    with Reader(writer.path) as reader:
        assert reader.message_count == 3 * 9


def test_another_setup_is_refused(writer: EpisodeWriter, setup: CaptureSetup, tmp_path: Path) -> None:
    other = replace(setup, camera=replace(setup.camera, fx=61.0))
    with pytest.raises(SetupDiffersError, match=r"fx 61\.00 pixels here, 60\.00 there"):
        EpisodeWriter.create(writer.path.parent.parent, other)
    writer.close()
    with pytest.raises(SetupDiffersError):
        EpisodeWriter.resume(writer.path, other)
    EpisodeWriter.resume(writer.path, setup).close()
    with pytest.raises(DataSetError, match="no data set"):
        EpisodeWriter.create(tmp_path / "nowhere", setup)


def test_two_cannot_write_one_episode(
    writer: EpisodeWriter, data_set: DataSet, scene: Scene, record: StepRecord
) -> None:
    writer.add_step(scene(0), record)
    for attempt in (
        lambda: EpisodeWriter.resume(writer.path),
        lambda: data_set.mark(writer.name, True),
        lambda: data_set.delete(writer.name),
    ):
        with pytest.raises(EpisodeBusyError, match="end that first"):
            attempt()
    writer.close()
    data_set.mark(writer.name, True)


def test_discarding_goes_to_the_trash(
    writer: EpisodeWriter, data_set: DataSet, scene: Scene, record: StepRecord
) -> None:
    writer.add_step(scene(0), record)
    writer.discard()
    assert data_set.trashed() == [writer.name] and data_set.episodes() == []
    empty = EpisodeWriter.create(data_set.path, data_set.setup)
    empty.discard()
    assert data_set.trashed() == [writer.name] and not empty.path.exists()
    again = EpisodeWriter.create(data_set.path, data_set.setup, writer.name)
    again.add_step(scene(0), record)
    again.discard()
    assert data_set.trashed() == [writer.name, f"{writer.name}-2"]


def test_a_bad_instruction_adds_nothing(writer: EpisodeWriter, scene: Scene, record: StepRecord) -> None:
    with pytest.raises(InstructionError):
        writer.add_step(scene(0), replace(record, instruction="x" * 10_000))
    assert writer.n_steps == 0 and not list(writer.path.glob("*.mcap"))


@pytest.mark.parametrize(
    ("refuses", "after"),
    [("chunk", 0), ("replace", 0), ("replace", 1), ("fsync", 0), ("fsync", 1), ("fsync", 2)],
)
def test_a_full_disk_leaves_the_steps_before_whole(
    writer: EpisodeWriter, scene: Scene, record: StepRecord, refuses: str, after: int
) -> None:
    writer.add_step(scene(0), record)
    calls = iter(range(100))
    target = {"fsync": (os, "fsync"), "replace": (os, "replace"), "chunk": (McapWriter, "close_chunk")}[refuses]
    real = getattr(*target)

    def full(*arguments: object) -> object:
        if next(calls) >= after:
            raise OSError(errno.ENOSPC, "No space left on device")
        return real(*arguments)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(*target, full)
        with pytest.raises(DiskFullError, match=r"No space left on device.*Free some space"):
            writer.add_step(scene(1), record)
    assert writer.n_steps == 1 and len(read_episode(writer.path).steps) == 1
    with Reader(writer.path) as reader:
        assert reader.message_count == 9
    writer.add_step(scene(1), record)
    assert len(read_episode(writer.path).steps) == 2
    assert not [p.name for p in writer.path.iterdir() if p.name.endswith(UNFINISHED)]


def test_a_file_that_may_not_grow_is_a_full_disk(writer: EpisodeWriter, scene: Scene, record: StepRecord) -> None:
    noise = replace(scene(0)[0], data=np.random.default_rng(0).bytes(3_000_000))

    def fill() -> None:
        """Runs in a process of its own: pytest's files may grow."""
        resource.setrlimit(resource.RLIMIT_FSIZE, (1_500_000, 1_500_000))
        try:
            writer.add_step([noise], record)
        except DiskFullError:
            os._exit(7)
        os._exit(1)

    child = multiprocessing.get_context("fork").Process(target=fill)
    child.start()
    child.join()
    assert child.exitcode == 7
    assert not list(writer.path.glob("*.mcap"))
    writer.add_step(scene(0), record)
    assert len(read_episode(writer.path).steps) == 1


def test_the_only_step_comes_back(writer: EpisodeWriter, scene: Scene, record: StepRecord) -> None:
    writer.add_step(scene(0), record)
    writer.undo_step()
    assert writer.n_steps == 0
    restored = writer.restore_step()
    assert restored == read_episode(writer.path).steps[0].record and restored.instruction == record.instruction
    assert writer.n_steps == 1


def test_a_disk_that_refuses_leaves_neither_a_folder_nor_a_lock(
    data_set: DataSet, setup: CaptureSetup, monkeypatch: pytest.MonkeyPatch
) -> None:
    released: list[FolderLock] = []
    release = FolderLock.release

    def refuse(writer: EpisodeWriter, edits: object) -> None:
        raise OSError("no space left on device")

    with monkeypatch.context() as patched:
        patched.setattr(EpisodeWriter, "_save", refuse)
        patched.setattr(FolderLock, "release", lambda lock: (released.append(lock), release(lock))[1])
        with pytest.raises(DiskError, match="no space left"):
            EpisodeWriter.create(data_set.path, setup, "mine")
    assert len(released) == 1
    EpisodeWriter.create(data_set.path, setup, "mine").close()
