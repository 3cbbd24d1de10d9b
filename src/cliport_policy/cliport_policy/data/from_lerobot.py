"""A data set of LeRobot that was written here, as episodes again."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from cliport_core import topics
from cliport_core.errors import CoreError
from cliport_core.image_files import decode_color_file, decode_gray_file
from cliport_episodes.capture_setup import CaptureSetup
from cliport_episodes.data_set import DataSet
from cliport_episodes.demonstration import StepRecord
from cliport_episodes.demonstration_messages import record_from_message
from cliport_episodes.errors import EpisodesError
from cliport_episodes.message_types import DEMONSTRATION
from cliport_episodes.observation import Observation
from cliport_episodes.observation_messages import messages_from_observation
from cliport_episodes.raw import RawMessage
from cliport_episodes.writer import EpisodeWriter
from cliport_policy.data import lerobot_format as form
from cliport_policy.data.new_folder import whole_folder
from cliport_policy.errors import DataError

Row = Mapping[str, Any]


def read_lerobot(folder: Path, out: Path) -> tuple[int, int]:
    """Write a data set of episodes from one of LeRobot, whole or not at all; return how many episodes and steps.

    The sentences are LeRobot's, so that those edited there count; pictures and actions are as they were recorded.

    Raises:
        DataError: where the folder is none that `write_lerobot` wrote, is damaged, or `out` can't be written.
    """
    if not (folder / form.INFO).is_file():
        raise DataError(f"{folder} is no data set of LeRobot: it has no {form.INFO}")
    if not (folder / form.SETUP).is_file():
        raise DataError(
            f"{folder} lacks {form.SETUP}: only what was written here knows camera, depth and boxes, which bags need"
        )
    with _damage(folder):
        own = json.loads((folder / form.SETUP).read_text(encoding="utf-8"))
        setup, described = CaptureSetup.from_dict(own["setup"]), list(own["episodes"])
        sentences = form.read_tasks(folder / form.TASKS)
    steps = 0
    with whole_folder(out) as temporary:
        data_set = temporary / out.name  # a data set's name must not begin with a dot
        DataSet.create(data_set, setup)
        for index, (rows, scenes) in enumerate(_episodes(folder, len(described))):
            with _damage(folder):
                episode = _EpisodeRead.of(described[index], rows, scenes, sentences)
            episode.write(data_set, setup)
            steps += len(episode.steps)
        for made in data_set.iterdir():
            made.rename(temporary / made.name)
        data_set.rmdir()
    return len(described), steps


@dataclass(frozen=True, eq=False)
class _EpisodeRead:
    """An episode as it lies in the files; final: the scene after the last step; success as in `Episode`."""

    name: str
    success: bool | None
    finished: bool
    steps: tuple[tuple[Observation, StepRecord], ...]
    final: Observation | None

    @classmethod
    def of(cls, described: Row, rows: list[Row], scenes: list[Row], sentences: Mapping[int, str]) -> _EpisodeRead:
        """Join the rows of `data` and ours. Raises DataError where they are not of the same steps."""
        rows = sorted(rows, key=lambda row: row["frame_index"])
        acted = sorted((scene for scene in scenes if scene["step"] != form.FINAL), key=lambda scene: scene["step"])
        final = next((scene for scene in scenes if scene["step"] == form.FINAL), None)
        if len(rows) != len(acted):
            counts = f"{len(rows)} rows in data and {len(acted)} in {form.STEPS}"
            raise DataError(f"episode {described['name']} has {counts}")
        steps = tuple(
            (
                _observation(scene, row[form.COLOR]["bytes"]),
                replace(_record(scene), instruction=sentences[row["task_index"]]),
            )
            for row, scene in zip(rows, acted, strict=True)
        )
        after = None if final is None else _observation(final, final["color"])
        return cls(str(described["name"]), described["success"], bool(described["finished"]), steps, after)

    def write(self, data_set: Path, setup: CaptureSetup) -> None:
        """Add it to a data set. Raises EpisodesError."""
        frames = setup.camera_frame, setup.base_frame
        writer = EpisodeWriter.create(data_set, setup, self.name)
        try:
            for seen, record in self.steps:
                writer.add_step(messages_from_observation(seen, *frames), record)
            if self.finished:
                writer.finish(
                    () if self.final is None else messages_from_observation(self.final, *frames), self.success
                )
        finally:
            writer.close()


def _record(scene: Row) -> StepRecord:
    return record_from_message(RawMessage(topics.DEMONSTRATION, DEMONSTRATION, scene["demonstration"], 0))


def _observation(scene: Row, color: bytes) -> Observation:
    seen = json.loads(scene["seen"])
    here = CaptureSetup.from_dict(seen["setup"])
    millimetres = decode_gray_file(scene["depth"]).astype(np.float32)
    depth = np.where(millimetres > 0, millimetres / 1000.0, np.nan).astype(np.float32)
    return Observation(
        int(seen["stamp_ns"]), decode_color_file(color), depth, here.camera, here.camera_in_base, seen["joints"]
    )


def _episodes(folder: Path, count: int) -> Iterator[tuple[list[Row], list[Row]]]:
    """Yield the rows of `data` and ours of each episode, with the pictures of one file in memory at a time."""
    with _damage(folder), pq.ParquetFile(folder / form.STEPS) as own:
        if own.num_row_groups != count:
            raise DataError(f"{form.STEPS} has {own.num_row_groups} episodes, {form.SETUP} has {count}")
        waiting = iter(range(count))
        for path in sorted((folder / "data").glob("*/*.parquet")):
            for number, rows in groupby(pq.read_table(path).to_pylist(), key=lambda row: row["episode_index"]):
                if number != next(waiting, None):
                    raise DataError(f"{path.name} has episode {number} where another one was to come")
                yield list(rows), own.read_row_group(number).to_pylist()
        if (missing := next(waiting, None)) is not None:
            raise DataError(f"the files of data end before episode {missing}")


@contextmanager
def _damage(folder: Path) -> Iterator[None]:
    """Turn what a damaged folder raises into one line."""
    try:
        yield
    except DataError as error:
        raise DataError(f"{folder} cannot be read: {error}") from error
    except (
        CoreError,
        EpisodesError,
        OSError,
        KeyError,
        ValueError,
        TypeError,
        AttributeError,
        pa.ArrowException,
    ) as error:
        words = f"it lacks {error}" if isinstance(error, KeyError) else " ".join(str(error).split())
        raise DataError(f"{folder} cannot be read: {words}") from error
