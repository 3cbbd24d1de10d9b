"""Recorded episodes as a data set of LeRobot."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from cliport_core.image_files import encode_png
from cliport_episodes.capture_setup import CaptureSetup
from cliport_episodes.demonstration import StepRecord
from cliport_episodes.demonstration_messages import messages_from_record
from cliport_episodes.observation import Observation
from cliport_episodes.reader import Episode, read_episode
from cliport_policy.data import lerobot_format as form
from cliport_policy.data.new_folder import whole_folder
from cliport_policy.errors import DataError

ROBOT = "franka"
_NO_JOINTS = ("none",)  # a state of one zero, where no joint was recorded: LeRobot's policies need one
_BYTES_PER_FILE = 90_000_000  # of pictures, below what the format has as its greatest


def write_lerobot(
    paths: Sequence[Path], out: Path, on_episode: Callable[[int, int], None] = lambda done, steps: None
) -> tuple[int, int]:
    """Write episodes' folders as a data set of LeRobot, whole or not at all; return how many episodes and steps.

    Colours are kept to the pixel, depth to the millimetre. on_episode: told how many episodes and steps are done.

    Raises:
        DataError: where set-ups differ or `out` can't be written. EpisodesError: where an episode can't be read.
    """
    with whole_folder(out) as folder:
        writer = _Writer(folder)
        for done, path in enumerate(paths, start=1):
            writer.add(read_episode(path))
            on_episode(done, writer.frames)
        return writer.finish()


class _Writer:
    """Writer of the files of one data set."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._setup: CaptureSetup | None = None
        self._joints: tuple[str, ...] = ()
        self._sentences: dict[str, int] = {}
        self._episodes: list[dict[str, Any]] = []
        self._rows: list[dict[str, Any]] = []  # of the present file of `data`
        self._own: list[dict[str, Any]] = []
        self._described: list[dict[str, Any]] = []
        self._stats = form.Statistics()
        self._files = 0
        self._own_writer: pq.ParquetWriter | None = None
        self.frames = 0

    def add(self, episode: Episode) -> None:
        """Add an episode's steps, if it has any."""
        if not episode.steps:
            return
        self._check(episode)
        first, number = self.frames, len(self._episodes)
        for frame, step in enumerate(episode.steps):
            seen = step.observation()
            self._check_joints(episode, seen)
            self._add_step(number, frame, step.record, seen, episode.setup)
        if episode.final is not None:
            self._own.append(self._own_row(number, form.FINAL, episode.final, episode.setup, color=episode.final.color))
        sentences = list(dict.fromkeys(step.record.instruction for step in episode.steps))
        self._episodes.append(
            {
                "episode_index": number,
                "tasks": sentences,
                "length": self.frames - first,
                "data/chunk_index": 0,
                "data/file_index": self._files,
                "dataset_from_index": first,
                "dataset_to_index": self.frames,
                "meta/episodes/chunk_index": 0,
                "meta/episodes/file_index": 0,
            }
        )
        self._described.append({"name": episode.name, "success": episode.success, "finished": episode.finished})
        self._flush_own()
        if sum(len(row[form.COLOR]["bytes"]) for row in self._rows) > _BYTES_PER_FILE:
            self._flush()

    def finish(self) -> tuple[int, int]:
        """Write what is left, and the descriptions."""
        if self._setup is None:
            raise DataError("no episode has a step: there is nothing to write")
        self._flush()
        if self._own_writer is not None:
            self._own_writer.close()
        camera = self._setup.camera
        form.write_tasks(self._place(form.TASKS), list(self._sentences))
        pq.write_table(pa.Table.from_pylist(self._episodes), self._place(form.EPISODES.format(0)))
        counts = (len(self._episodes), self.frames, len(self._sentences))
        info = form.info_of(camera.height, camera.width, self._joints, *counts, ROBOT)
        own = {"setup": self._setup.to_dict(), "episodes": self._described}
        for name, values in ((form.INFO, info), (form.STATS, self._stats.to_dict()), (form.SETUP, own)):
            self._place(name).write_text(json.dumps(values, indent=2) + "\n", encoding="utf-8")
        return counts[0], counts[1]

    def _check(self, episode: Episode) -> None:
        if self._setup is None:
            self._setup = episode.setup
        if differences := self._setup.differences(episode.setup):
            raise DataError(
                f"episode {episode.name} was recorded with another set-up ({'; '.join(differences)}): "
                "write those of each set-up to a folder of their own"
            )

    def _check_joints(self, episode: Episode, seen: Observation) -> None:
        names = tuple(seen.joint_positions) or _NO_JOINTS
        self._joints = self._joints or names
        if set(names) != set(self._joints):
            raise DataError(
                f"episode {episode.name} has the joints {', '.join(names)}, those before it {', '.join(self._joints)}: "
                "write those of each arm to a folder of their own"
            )

    def _add_step(self, episode: int, frame: int, record: StepRecord, seen: Observation, setup: CaptureSetup) -> None:
        state = [seen.joint_positions.get(name, 0.0) for name in self._joints]
        pick, place = record.action.pick, record.action.place
        action = [pick.x, pick.y, pick.yaw, place.x, place.y, place.yaw, float(record.action.primitive)]
        task = self._sentences.setdefault(record.instruction, len(self._sentences))
        row = {
            form.STATE: state if len(state) > 1 else state[0],
            form.ACTION: action,
            "timestamp": frame / form.FPS,
            "frame_index": frame,
            "episode_index": episode,
            "index": self.frames,
            "task_index": task,
        }
        for name, value in row.items():
            self._stats.add(name, value)
        self._stats.add(form.COLOR, seen.color / 255.0, axes=(0, 1))
        self._rows.append({**row, form.COLOR: {"bytes": encode_png(seen.color), "path": None}})
        message = messages_from_record(record, record.stamp_ns)[-1]
        self._own.append(self._own_row(episode, record.step, seen, setup, demonstration=message.data))
        self.frames += 1

    def _own_row(
        self, episode: int, step: int, seen: Observation, setup: CaptureSetup, demonstration: bytes | None = None,
        color: np.ndarray | None = None,
    ) -> dict[str, Any]:  # fmt: skip
        here = CaptureSetup(setup.workspace, seen.camera, setup.camera_frame, setup.base_frame, seen.camera_in_base)
        depth = np.nan_to_num(np.rint(1000.0 * seen.depth_m), nan=0.0, posinf=0.0).clip(0, 65535).astype(np.uint16)
        described = {"stamp_ns": seen.stamp_ns, "joints": seen.joint_positions, "setup": here.to_dict()}
        return {
            "episode_index": episode,
            "step": step,
            "demonstration": demonstration,
            "depth": encode_png(depth),
            "color": None if color is None else encode_png(color),
            "seen": json.dumps(described),
        }

    def _flush(self) -> None:
        if not self._rows:
            return
        table = pa.Table.from_pylist(self._rows, schema=form.data_schema(len(self._joints)))
        pq.write_table(table, self._place(form.DATA.format(self._files)))
        self._rows, self._files = [], self._files + 1

    def _flush_own(self) -> None:
        if self._own_writer is None:
            self._own_writer = pq.ParquetWriter(self._place(form.STEPS), form.OWN_SCHEMA)
        self._own_writer.write_table(pa.Table.from_pylist(self._own, schema=form.OWN_SCHEMA))
        self._own = []

    def _place(self, name: str) -> Path:
        path = self._folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        return path
