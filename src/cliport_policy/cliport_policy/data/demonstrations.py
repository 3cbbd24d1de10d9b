"""Demonstrations on disk and in memory: Parquet with PNG-encoded heightmaps, read once and kept decoded."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pyarrow.parquet as pq
from numpy.typing import NDArray

from cliport_perception.workspace import WorkspaceSpec
from cliport_policy.errors import DataError

FORMAT_VERSIONS = (1, 2)  # what differs between them is not read here
HEIGHT_UNIT = 1e-4  # m: heights are stored as 16-bit integers above the workspace's z_min


@dataclass(frozen=True)
class Demonstration:
    """What the expert did for one instruction in one observation; done: nothing remains, and no poses are given.

    Pixels are (row, col); yaws are rad about +z; the picked object looks the same every pick_yaw_period rad.
    """

    instruction: str
    done: bool
    pick_pixel: tuple[int, int]
    pick_yaw: float
    pick_yaw_period: float
    place_pixel: tuple[int, int]
    place_yaw: float


@dataclass(frozen=True)
class Frame:
    """One observation and the demonstrations given in it (the first is the episode's own)."""

    color: NDArray[np.uint8]  # (rows, cols, 3)
    height: NDArray[np.uint16]  # (rows, cols) in HEIGHT_UNIT above z_min
    valid: NDArray[np.bool_]  # (rows, cols)
    demos: tuple[Demonstration, ...]
    episode: int
    step: int


@dataclass(frozen=True)
class DemonstrationSet:
    """All frames of a data set folder, decoded: about 0.3 MB each. meta is what made it."""

    frames: list[Frame]
    workspace: WorkspaceSpec
    meta: dict[str, Any]

    def height_m(self, frame: Frame) -> NDArray[np.float32]:
        """(rows, cols) float32 m, 0 where nothing was seen."""
        height = frame.height.astype(np.float32) * HEIGHT_UNIT + self.workspace.z_min
        return np.where(frame.valid, height, np.float32(0))

    def samples(self) -> list[tuple[int, int]]:
        """(frame, demonstration) index pairs."""
        return [(i, j) for i, frame in enumerate(self.frames) for j in range(len(frame.demos))]


def load_demonstrations(folder: str | Path, max_frames: int | None = None) -> DemonstrationSet:
    """Read a data set folder.

    Raises DataError, naming the file, where it is missing, of another version or damaged.
    """
    folder = Path(folder)
    meta = _read_meta(folder)
    try:
        workspace = WorkspaceSpec.from_dict(meta["workspace"])
    except Exception as error:
        raise DataError(f"{folder}/meta.json holds no usable workspace ({error}): generate it again") from error
    frames: list[Frame] = []
    for part in sorted(folder.glob("part-*.parquet")):
        for frame in _read_part(part):
            frames.append(frame)
            if max_frames is not None and len(frames) >= max_frames:
                return DemonstrationSet(frames, workspace, meta)
    if not frames:
        raise DataError(f"{folder} holds no part-*.parquet: generate demonstrations first (cliport_benchmark generate)")
    return DemonstrationSet(frames, workspace, meta)


def _read_meta(folder: Path) -> dict[str, Any]:
    path = folder / "meta.json"
    if not path.is_file():
        raise DataError(f"no data set at {folder} (meta.json is missing): make one with cliport_benchmark generate")
    try:
        meta = json.loads(path.read_text())
    except ValueError as error:
        raise DataError(f"{path} is not JSON ({error}): generate the data set again") from error
    if not isinstance(meta, dict) or meta.get("version") not in FORMAT_VERSIONS:
        known = " and ".join(str(version) for version in FORMAT_VERSIONS)
        raise DataError(f"{path} has version {meta.get('version')!r}, this reader knows {known}: generate again")
    return meta


def _read_part(path: Path) -> Iterator[Frame]:
    try:
        table = pq.ParquetFile(path)
        for batch in table.iter_batches(batch_size=64):
            for row in batch.to_pylist():
                yield _frame(row)
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise DataError(f"{path} can't be read ({error}): delete it and run generate again") from error


def _frame(row: dict[str, Any]) -> Frame:
    return Frame(
        color=cv2.cvtColor(_png(row["color_png"], cv2.IMREAD_COLOR), cv2.COLOR_BGR2RGB),
        height=_png(row["height_png"], cv2.IMREAD_UNCHANGED).astype(np.uint16),
        valid=_png(row["valid_png"], cv2.IMREAD_UNCHANGED) > 0,
        demos=tuple(_demonstration(demo) for demo in row["demos"]),
        episode=row["episode"],
        step=row["step"],
    )


def _demonstration(demo: dict[str, Any]) -> Demonstration:
    return Demonstration(
        instruction=demo["instruction"],
        done=demo["done"],
        pick_pixel=(demo["pick_row"], demo["pick_col"]),
        pick_yaw=demo["pick_yaw"],
        pick_yaw_period=demo["pick_yaw_period"],
        place_pixel=(demo["place_row"], demo["place_col"]),
        place_yaw=demo["place_yaw"],
    )


def _png(data: bytes, flags: int) -> NDArray[Any]:
    image = cv2.imdecode(np.frombuffer(data, np.uint8), flags)
    if image is None:
        raise ValueError("an image is damaged")
    return image
