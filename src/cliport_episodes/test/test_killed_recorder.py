"""A recorder that is killed, at each moment at which that could hurt."""

from __future__ import annotations

import multiprocessing
import os
import signal
import time
from collections.abc import Callable
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import pytest
from rosbags.rosbag2 import Reader

from cliport_core.whole_file import UNFINISHED
from cliport_episodes.capture_setup import CaptureSetup
from cliport_episodes.data_set import DataSet
from cliport_episodes.demonstration import StepRecord
from cliport_episodes.errors import EpisodeBusyError
from cliport_episodes.raw import RawMessage
from cliport_episodes.reader import read_episode
from cliport_episodes.writer import EpisodeWriter

Scene = Callable[[int], list[RawMessage]]
FORK = multiprocessing.get_context("fork")


def record_until_killed(
    path: Path, setup: CaptureSetup, scene: Scene, record: StepRecord, told: Connection, die_at: int | None
) -> None:
    """Add steps and tell each that is done; after the first, be killed before the `die_at`-th call that counts."""
    writer = EpisodeWriter.create(path, setup, "killed")
    for moment in range(1000):
        if moment == 1 and die_at is not None:
            die_before_call(die_at)
        writer.add_step(scene(moment), record)
        told.send(moment + 1)


def undo_until_killed(
    path: Path, setup: CaptureSetup, scene: Scene, record: StepRecord, told: Connection, die_at: int
) -> None:
    """Add three steps, and be killed before the `die_at`-th call that counts while they are undone."""
    writer = EpisodeWriter.create(path, setup, "killed")
    for moment in range(3):
        writer.add_step(scene(moment), record)
    told.send(3)
    die_before_call(die_at)
    for left in (2, 1):
        writer.undo_step()
        told.send(left)


def die_before_call(number: int) -> None:
    """Have this process killed at one of the calls that change what is on the disk."""
    count = iter(range(1000))
    for name in ("fsync", "replace", "unlink", "rename"):
        setattr(os, name, _deadly(getattr(os, name), count, number))


def _deadly(call: Callable[..., Any], count: Any, die_at: int) -> Callable[..., Any]:
    def deadly(*arguments: Any, **keywords: Any) -> Any:
        if next(count) == die_at:
            os.kill(os.getpid(), signal.SIGKILL)
        return call(*arguments, **keywords)

    return deadly


@pytest.mark.parametrize(("die_at", "seconds"), [*((n, None) for n in range(8)), (None, 0.1), (None, 0.4)])
def test_no_step_that_was_added_is_lost(
    data_set: DataSet,
    setup: CaptureSetup,
    scene: Scene,
    record: StepRecord,
    add_episode: Callable[..., str],
    die_at: int | None,
    seconds: float | None,
) -> None:
    earlier = add_episode(data_set.path, n_steps=1)
    here, there = FORK.Pipe(duplex=False)
    child = FORK.Process(target=record_until_killed, args=(data_set.path, setup, scene, record, there, die_at))
    child.start()
    there.close()
    added = here.recv()
    path = data_set.path / "episodes" / "killed"
    if seconds is not None:
        with pytest.raises(EpisodeBusyError, match="'killed' is being recorded or changed elsewhere"):
            EpisodeWriter.resume(path)
        time.sleep(seconds)
        child.kill()
    try:
        while True:
            added = here.recv()
    except EOFError:
        child.join()
    assert child.exitcode == -signal.SIGKILL

    episode = read_episode(path)
    assert added <= len(episode.steps) <= added + 1 and episode.complaints == ()
    assert all(step.observation().color.any() for step in episode.steps)
    assert data_set.episode(earlier).complaints == () and len(data_set.episodes()) == 2
    with Reader(path) as reader:
        assert reader.message_count in (9 * added, 9 * (added + 1))

    resumed = EpisodeWriter.resume(path)
    resumed.add_step(scene(2000), record)
    resumed.finish(scene(2001), True)
    assert len(read_episode(path).steps) == len(episode.steps) + 1
    assert not [file.name for file in path.iterdir() if file.name.endswith(UNFINISHED)]


@pytest.mark.parametrize("die_at", range(14))
def test_an_undo_removes_the_last_step_or_nothing(
    data_set: DataSet, setup: CaptureSetup, scene: Scene, record: StepRecord, die_at: int
) -> None:
    here, there = FORK.Pipe(duplex=False)
    child = FORK.Process(target=undo_until_killed, args=(data_set.path, setup, scene, record, there, die_at))
    child.start()
    there.close()
    left = 3
    try:
        while True:
            left = here.recv()
    except EOFError:
        child.join()
    assert child.exitcode == -signal.SIGKILL
    path = data_set.path / "episodes" / "killed"
    episode = read_episode(path)
    assert left - 1 <= len(episode.steps) <= left and episode.complaints == ()
    with Reader(path) as reader:
        assert left - 1 <= reader.message_count // 9 <= left
    assert len(episode.steps) + data_set.undone_steps() == 3
