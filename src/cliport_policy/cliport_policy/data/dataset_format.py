"""Data set on disk: meta.json beside part-NNNNN.parquet files, a row for each observation, images as PNG."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from cliport_core.action import Primitive
from cliport_core.errors import ImageError
from cliport_core.heightmap import Heightmap
from cliport_core.image_files import decode_color_file, decode_gray_file, encode_png
from cliport_core.pose import PlanarPose
from cliport_core.whole_file import whole_file
from cliport_core.workspace import WorkspaceSpec
from cliport_policy.errors import DataError

FORMAT_VERSION = 3  # 3 added the column `things` and demonstrations of goals that were reached before
# Step of height_png [m], which counts from the workspace's z_min. Finer steps would store the sensor's noise and double
# the size of files.
HEIGHT_UNIT = 5e-4
_COLOR_BITS = 0xFE
# PNG filter and zlib strategy that make noisy images smallest.
_PNG = [cv2.IMWRITE_PNG_COMPRESSION, 6, cv2.IMWRITE_PNG_FILTER, cv2.IMWRITE_PNG_FILTER_SUB, cv2.IMWRITE_PNG_STRATEGY]
_COLOR_PNG = [*_PNG, cv2.IMWRITE_PNG_STRATEGY_RLE]
_HEIGHT_PNG = [*_PNG, cv2.IMWRITE_PNG_STRATEGY_FILTERED]
META_NAME = "meta.json"

DEMO_TYPE = pa.struct(
    [
        ("instruction", pa.string()),
        ("done", pa.bool_()),
        ("primitive", pa.string()),
        ("pick_row", pa.int32()),
        ("pick_col", pa.int32()),
        ("pick_yaw", pa.float32()),
        ("pick_yaw_period", pa.float32()),
        ("place_row", pa.int32()),
        ("place_col", pa.int32()),
        ("place_yaw", pa.float32()),
    ]
)
THING_TYPE = pa.struct(
    [("name", pa.string()), ("color", pa.string()), ("rgb", pa.int32()), ("row", pa.int32()), ("col", pa.int32())]
)
SCHEMA = pa.schema(
    [
        ("task", pa.string()),
        ("split", pa.string()),
        ("seed", pa.int64()),
        ("episode", pa.int64()),
        ("step", pa.int32()),
        ("color_png", pa.binary()),
        ("height_png", pa.binary()),
        ("valid_png", pa.binary()),
        ("demos", pa.list_(DEMO_TYPE)),
        ("things", pa.list_(THING_TYPE)),
    ]
)


@dataclass(frozen=True)
class Demo:
    """Expert's action in one observation for one goal; yaws in rad, pixels -1 when `done`.

    primitive: pick_place, sweep or fold.
    """

    instruction: str
    done: bool
    primitive: str
    pick_row: int = -1
    pick_col: int = -1
    pick_yaw: float = 0.0
    pick_yaw_period: float = 0.0
    place_row: int = -1
    place_col: int = -1
    place_yaw: float = 0.0

    @classmethod
    def of_action(
        cls,
        instruction: str,
        primitive: Primitive,
        pick: PlanarPose,
        pick_yaw_period: float,
        place: PlanarPose,
        workspace: WorkspaceSpec,
    ) -> Demo:
        """Make the demonstration of an action on the workspace's heightmap.

        Raises:
            PixelOutsideError: if the pick or the place lies outside the workspace.
        """
        pick_row, pick_col = workspace.xy_to_pixel(pick.x, pick.y)
        place_row, place_col = workspace.xy_to_pixel(place.x, place.y)
        return cls(
            instruction=instruction,
            done=False,
            primitive=primitive.label,
            pick_row=pick_row,
            pick_col=pick_col,
            pick_yaw=pick.yaw,
            pick_yaw_period=pick_yaw_period,
            place_row=place_row,
            place_col=place_col,
            place_yaw=place.yaw,
        )


@dataclass(frozen=True)
class SeenThing:
    """One thing on the table, in words.

    name: what sentences call it. color: the benchmark's name of its colour, "" for what has one of its own.
    rgb: 0xRRGGBB, its colour where its mesh has none. Pixel of its origin; -1 outside the workspace.
    """

    name: str
    color: str
    rgb: int
    row: int
    col: int


@dataclass(frozen=True, eq=False)
class Row:
    """One observation and its demonstrations.

    demos[0] is for the episode's own goal; those of goals that were reached before are done.
    things: all that lies on the table, distractors too.
    """

    task: str
    split: str
    seed: int
    episode: int
    step: int
    heightmap: Heightmap
    demos: tuple[Demo, ...]
    things: tuple[SeenThing, ...] = ()


def part_path(folder: Path, index: int) -> Path:
    """Return the path of a part."""
    return folder / f"part-{index:05d}.parquet"


def write_part(path: Path, rows: list[Row]) -> None:
    """Write rows as a part that appears whole or not at all.

    Raises:
        DataError: if it can't be written.
    """
    columns: dict[str, list[Any]] = {name: [] for name in SCHEMA.names}
    for row in rows:
        color, height, valid = encode_heightmap(row.heightmap)
        which = (row.task, row.split, row.seed, row.episode, row.step)
        words = [asdict(demo) for demo in row.demos], [asdict(thing) for thing in row.things]
        values = (*which, color, height, valid, *words)
        for name, value in zip(SCHEMA.names, values, strict=True):
            columns[name].append(value)
    try:
        with whole_file(path) as temporary:
            pq.write_table(pa.table(columns, schema=SCHEMA), temporary, compression="none", row_group_size=64)
    except OSError as error:
        raise DataError(f"cannot write {path}: {error.strerror or error}") from error


def read_part(path: Path, workspace: WorkspaceSpec) -> list[Row]:
    """Read the rows of a part.

    Raises:
        DataError: if the file is absent or not a part.
    """
    try:
        present = set(pq.read_schema(path).names)
        records = pq.read_table(path, columns=[name for name in SCHEMA.names if name in present]).to_pylist()
    except (OSError, pa.ArrowException) as error:
        reason = str(error).splitlines()[0]
        raise DataError(f"cannot read {path}: {reason}; generate it again") from error
    rows: list[Row] = []
    for record in records:
        heightmap = decode_heightmap(record["color_png"], record["height_png"], record["valid_png"], workspace)
        demos = tuple(Demo(**values) for values in record["demos"])
        rows.append(
            Row(
                task=record["task"],
                split=record["split"],
                seed=record["seed"],
                episode=record["episode"],
                step=record["step"],
                heightmap=heightmap,
                demos=demos,
                things=tuple(SeenThing(**values) for values in record.get("things", ())),
            )
        )
    return rows


def encode_heightmap(heightmap: Heightmap) -> tuple[bytes, bytes, bytes]:
    """Return PNGs of colour (RGB, 7 bits a channel), height (16 bit, HEIGHT_UNIT above z_min) and validity (1 bit)."""
    steps = np.rint((heightmap.height - heightmap.workspace.z_min) / HEIGHT_UNIT)
    height = np.clip(steps, 0, 65535).astype(np.uint16)
    valid = heightmap.valid.astype(np.uint8) * 255
    return (
        encode_png(heightmap.color & np.uint8(_COLOR_BITS), _COLOR_PNG),
        encode_png(height, _HEIGHT_PNG),
        encode_png(valid, [cv2.IMWRITE_PNG_COMPRESSION, 9, cv2.IMWRITE_PNG_BILEVEL, 1]),
    )


def decode_heightmap(color: bytes, height: bytes, valid: bytes, workspace: WorkspaceSpec) -> Heightmap:
    """Invert `encode_heightmap`, heights to within half a HEIGHT_UNIT, colours to within 1.

    Raises:
        DataError: when an image is damaged.
    """
    try:
        rgb, mask = decode_color_file(color), decode_gray_file(valid) > 0
        metres = decode_gray_file(height).astype(np.float32) * np.float32(HEIGHT_UNIT)
    except ImageError as error:
        raise DataError(f"an image in the data set is no readable PNG ({error}); generate that part again") from None
    metres = np.where(mask, metres + np.float32(workspace.z_min), np.float32(0.0)).astype(np.float32)
    return Heightmap(rgb, metres, mask, workspace)
