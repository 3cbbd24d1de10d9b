"""Demonstrations on disk: an index of what the experts did, and observations decoded when they are asked for."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from cliport_core.action import Primitive
from cliport_core.errors import CoreError, ImageError
from cliport_core.heightmap import Heightmap
from cliport_core.image_files import decode_color_file, decode_gray_file
from cliport_core.workspace import WorkspaceSpec
from cliport_policy.data.encoded_rows import IMAGES, EncodedRows, Place
from cliport_policy.errors import DataError

FORMAT_VERSIONS = (1, 2, 3)  # 1 has no primitives, 1 and 2 do not list the things on the table
UNSTATED_HEIGHT_UNIT = 1e-4  # m: of stored heights above the workspace's z_min, where a data set does not say
CACHE_BYTES = 4 << 30  # of encoded observations in memory: about 40,000


@dataclass(frozen=True)
class Demonstration:
    """The expert's action for one instruction in one observation.

    done: nothing remains; absent: the sentence names what is not there. No poses are given then.

    Pixels are (row, col); yaws are rad about +z; the picked object looks the same every pick_yaw_period rad.
    """

    instruction: str
    done: bool
    pick_pixel: tuple[int, int]
    pick_yaw: float
    pick_yaw_period: float
    place_pixel: tuple[int, int]
    place_yaw: float
    primitive: Primitive = Primitive.PICK_PLACE
    absent: bool = False

    @property
    def acts(self) -> bool:
        """True if there is something to be done."""
        return not (self.done or self.absent)


@dataclass(frozen=True)
class Frame:
    """One observation's place on disk, and the demonstrations given in it (the first is the episode's own).

    things: (colour, name) of each kind of thing on the table, sorted; empty where the data set does not say.
    """

    place: Place
    demos: tuple[Demonstration, ...]
    task: str
    episode: int
    step: int
    things: tuple[tuple[str, str], ...] = ()


class Index(NamedTuple):
    """Indices of a demonstration in a set: its frame, and its number there."""

    frame: int
    demo: int


@dataclass(frozen=True)
class DemonstrationSet:
    """The frames of a data set folder, by task, episode and step; meta is what made it."""

    frames: list[Frame]
    workspace: WorkspaceSpec
    meta: dict[str, Any]
    rows: EncodedRows
    folder: Path

    def observation(self, frame: Frame) -> Heightmap:
        """Decode a frame; heights are 0 where nothing was seen. Raises DataError where an image is damaged."""
        encoded = self.rows.read(frame.place)
        try:
            color, valid = decode_color_file(encoded[0]), decode_gray_file(encoded[2]) > 0
            units = decode_gray_file(encoded[1]).astype(np.float32)
            units *= np.float32(self.meta.get("height_unit", UNSTATED_HEIGHT_UNIT))
            height = np.where(valid, units + np.float32(self.workspace.z_min), np.float32(0))
            if {color.shape[:2], height.shape, valid.shape} != {self.workspace.shape}:
                raise ValueError(f"an image is not of the workspace's shape {self.workspace.shape}")
        except (ValueError, ImageError) as error:
            raise DataError(
                f"episode {frame.episode}, step {frame.step} of {self.folder} can't be decoded "
                f"({' '.join(str(error).split())[:120]}): delete its part and run generate again"
            ) from None
        return Heightmap(color, height, valid, self.workspace, 0)

    def samples(self) -> list[Index]:
        """Return the indices of all demonstrations."""
        indices: list[Index] = []
        for i, frame in enumerate(self.frames):
            indices += [Index(i, j) for j in range(len(frame.demos))]
        return indices

    def demo(self, index: Index) -> Demonstration:
        """Return the demonstration of an index."""
        return self.frames[index.frame].demos[index.demo]

    def goal_frames(self) -> dict[int, int]:
        """Return, by frame number, the frame that a frame's own demonstration leads to (paper, appendix F).

        The next observation for a task with a sentence a step (meta's `stepwise`), the episode's last one for others;
        absent where the episode has no observation of its finished scene.
        """
        goals: dict[int, int] = {}
        last = len(self.frames) - 1
        for i in range(last, -1, -1):
            frame = self.frames[i]
            if i == last or _episode_of(self.frames[i + 1]) != _episode_of(frame):
                last = i
            if not self.frames[last].demos[0].done:
                continue
            goals[i] = min(i + 1, last) if self._is_stepwise(frame) else last
        return goals

    def _is_stepwise(self, frame: Frame) -> bool:
        """Return True if each sentence of the frame's task asks for one action; older sets say so by its name."""
        return bool(self.meta.get("stepwise", "-seq" in frame.task))

    def first_episodes(self, count: int) -> DemonstrationSet:
        """Return the first `count` episodes of each task, whole.

        Raises DataError where a task has fewer.
        """
        episodes: dict[str, list[int]] = {}
        for frame in self.frames:
            known = episodes.setdefault(frame.task, [])
            if frame.episode not in known[-1:]:
                known.append(frame.episode)
        for task, known in episodes.items():
            if len(known) < count:
                raise DataError(
                    f"{self.folder} has {len(known)} demonstrations of {task or 'its task'}, {count} were asked for: "
                    "generate more or give a smaller --n-demos"
                )
        kept = {(task, episode) for task, known in episodes.items() for episode in known[:count]}
        frames = [frame for frame in self.frames if _episode_of(frame) in kept]
        return DemonstrationSet(frames, self.workspace, self.meta, self.rows, self.folder)


def load_demonstrations(folder: str | Path, cache_bytes: int = CACHE_BYTES) -> DemonstrationSet:
    """Index a data set folder; images stay on disk, but for at most cache_bytes of what was read last.

    Raises DataError, naming the file, where it is missing, empty, of another version or damaged.
    """
    folder = Path(folder)
    meta = _read_meta(folder)
    try:
        workspace = WorkspaceSpec.from_dict(meta["workspace"])
    except (CoreError, KeyError, TypeError, ValueError, AttributeError) as error:
        raise DataError(f"{folder}/meta.json holds no usable workspace ({error}): generate it again") from error
    parts = sorted(folder.glob("part-*.parquet"))
    frames: list[Frame] = []
    for number, part in enumerate(parts):
        frames += _read_part(part, number, meta.get("task", ""))
    if not frames:
        raise DataError(f"{folder} holds no demonstrations: generate some first (cliport_benchmark generate)")
    frames.sort(key=lambda frame: (frame.task, frame.episode, frame.step))
    _check(frames, workspace, folder)
    return DemonstrationSet(frames, workspace, meta, EncodedRows(parts, cache_bytes), folder)


def _check(frames: list[Frame], workspace: WorkspaceSpec, folder: Path) -> None:
    for before, after in pairwise(frames):
        if (_episode_of(before), before.step) == (_episode_of(after), after.step):
            raise DataError(f"{folder} holds episode {after.episode} twice: delete one of its parts")
    for frame in frames:
        for demo in frame.demos:
            pixels = () if demo.done else (demo.pick_pixel, demo.place_pixel)
            if any(not 0 <= at < size for pixel in pixels for at, size in zip(pixel, workspace.shape, strict=True)):
                raise DataError(
                    f"episode {frame.episode} of {folder} acts at the pixels {pixels}, outside its workspace of "
                    f"{workspace.shape}: generate it again"
                )


def _episode_of(frame: Frame) -> tuple[str, int]:
    return frame.task, frame.episode


def _read_meta(folder: Path) -> dict[str, Any]:
    path = folder / "meta.json"
    if not path.is_file():
        raise DataError(f"no data set at {folder} (meta.json is missing): make one with cliport_benchmark generate")
    try:
        meta = json.loads(path.read_text())
    except (OSError, ValueError) as error:
        raise DataError(f"{path} is not JSON ({error}): generate the data set again") from error
    if not isinstance(meta, dict) or meta.get("version") not in FORMAT_VERSIONS:
        version = meta.get("version") if isinstance(meta, dict) else None
        known = ", ".join(str(version) for version in FORMAT_VERSIONS)
        raise DataError(f"{path} has version {version!r}, this reader knows {known}: generate again")
    return meta


def _read_part(path: Path, number: int, task: str) -> Iterator[Frame]:
    """Yield the frames of a part without their images."""
    try:
        with pq.ParquetFile(path) as file:
            names = file.schema_arrow.names
            missing = {*IMAGES, "episode", "step", "demos"} - set(names)
            if missing:
                raise KeyError(f"no column {sorted(missing)[0]}")
            columns = [name for name in names if name not in IMAGES]
            for group in range(file.num_row_groups):
                for row, values in enumerate(file.read_row_group(group, columns).to_pylist()):
                    demos = tuple(_demonstration(demo) for demo in values["demos"])
                    if not demos:
                        raise ValueError(f"episode {values['episode']} has no demonstration")
                    place = Place(number, group, row)
                    kinds = {(thing["color"], thing["name"]) for thing in values.get("things") or ()}
                    where = (values.get("task", task), values["episode"], values["step"])
                    yield Frame(place, demos, *where, tuple(sorted(kinds)))
    except (OSError, ValueError, KeyError, TypeError, pa.ArrowException) as error:
        reason = " ".join(str(error).split())[:160]
        raise DataError(f"{path} can't be read ({reason}): delete it and run generate again") from error


def _demonstration(demo: dict[str, Any]) -> Demonstration:
    numbers: Sequence[float] = [demo[name] for name in ("pick_yaw", "pick_yaw_period", "place_yaw")]
    if not all(math.isfinite(number) for number in numbers):
        raise ValueError(f"a yaw is not a number: {demo}")
    return Demonstration(
        instruction=demo["instruction"],
        done=demo["done"],
        pick_pixel=(demo["pick_row"], demo["pick_col"]),
        pick_yaw=demo["pick_yaw"],
        pick_yaw_period=demo["pick_yaw_period"],
        place_pixel=(demo["place_row"], demo["place_col"]),
        place_yaw=demo["place_yaw"],
        primitive=Primitive.from_label(demo.get("primitive", Primitive.PICK_PLACE.label)),  # version 1 does not say
    )
