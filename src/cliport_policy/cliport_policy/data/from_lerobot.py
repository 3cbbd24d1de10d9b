"""A data set of LeRobot that was written here, as episodes again."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
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
    with whole_folder(out) as temporary, _damage(folder):
        own = json.loads((folder / form.SETUP).read_text(encoding="utf-8"))
        setup = CaptureSetup.from_dict(own["setup"])
        sentences = form.read_tasks(folder / form.TASKS)
        place = temporary / out.name  # a data set's name must not begin with a dot
        DataSet.create(place, setup)
        rows = _by_episode(pq.read_table(path) for path in sorted((folder / "data").glob("*/*.parquet")))
        scenes = _by_episode([pq.read_table(folder / form.STEPS)])
        steps = 0
        for index, described in enumerate(own["episodes"]):
            steps += _write_episode(place, setup, described, rows[index], scenes[index], sentences)
        for made in place.iterdir():
            made.rename(temporary / made.name)
        place.rmdir()
    return len(own["episodes"]), steps


def _write_episode(
    data_set: Path,
    setup: CaptureSetup,
    described: Row,
    rows: list[Row],
    scenes: list[Row],
    sentences: Mapping[int, str],
) -> int:
    """Write an episode; return the number of its steps."""
    rows = sorted(rows, key=lambda row: row["frame_index"])
    acted = sorted((scene for scene in scenes if scene["step"] != form.FINAL), key=lambda scene: scene["step"])
    final = next((scene for scene in scenes if scene["step"] == form.FINAL), None)
    if len(rows) != len(acted):
        raise DataError(f"episode {described['name']} has {len(rows)} rows in data and {len(acted)} in {form.STEPS}")
    writer = EpisodeWriter.create(data_set, setup, described["name"])
    try:
        for row, scene in zip(rows, acted, strict=True):
            seen = _observation(scene, row[form.COLOR]["bytes"])
            record = replace(_record(scene), instruction=sentences[row["task_index"]])
            writer.add_step(messages_from_observation(seen, setup.camera_frame, setup.base_frame), record)
        if described["finished"]:
            shown = () if final is None else messages_from_observation(
                _observation(final, final["color"]), setup.camera_frame, setup.base_frame
            )  # fmt: skip
            writer.finish(shown, described["success"])
    finally:
        writer.close()
    return len(acted)


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


def _by_episode(tables: Any) -> dict[int, list[Row]]:
    found: dict[int, list[Row]] = {}
    for table in tables:
        for row in table.to_pylist():
            found.setdefault(row["episode_index"], []).append(row)
    return found


@contextmanager
def _damage(folder: Path) -> Iterator[None]:
    """Turn what a damaged folder raises into one line."""
    try:
        yield
    except (CoreError, EpisodesError, KeyError, ValueError, TypeError, AttributeError, pa.ArrowException) as error:
        words = f"it lacks {error}" if isinstance(error, KeyError) else " ".join(str(error).split())
        raise DataError(f"{folder} cannot be read: {words}") from error
