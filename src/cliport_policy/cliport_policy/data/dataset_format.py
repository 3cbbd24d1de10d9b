"""The data set on disk: meta.json beside part-NNNNN.parquet files, a row an observation, images as PNG."""

from __future__ import annotations

import os
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt
import pyarrow as pa
import pyarrow.parquet as pq

from cliport_perception.heightmap import Heightmap
from cliport_perception.pose import PlanarPose
from cliport_perception.primitive import Primitive
from cliport_perception.workspace import WorkspaceSpec
from cliport_policy.errors import DataError

FORMAT_VERSION = 2
# What is finer than this is the sensor's noise, and half of a file's size.
HEIGHT_UNIT = 5e-4  # of a step of height_png, which counts from the workspace's z_min [m]
_COLOR_BITS = 0xFE
# What makes noisy images smallest, of PNG's filters and zlib's strategies.
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
    ]
)


@dataclass(frozen=True)
class Demo:
    """What an expert does in one observation for one goal; yaws in rad, pixels -1 when `done`.

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
        """An action on the workspace's heightmap. Raises PixelOutsideError."""
        return cls(
            instruction,
            False,
            primitive.name.lower(),
            *workspace.xy_to_pixel(pick.x, pick.y),
            pick.yaw,
            pick_yaw_period,
            *workspace.xy_to_pixel(place.x, place.y),
            place.yaw,
        )


@dataclass(frozen=True, eq=False)
class Row:
    """One observation; demos[0] is the episode's own goal."""

    task: str
    split: str
    seed: int
    episode: int
    step: int
    heightmap: Heightmap
    demos: tuple[Demo, ...]


def part_path(folder: Path, index: int) -> Path:
    """The file of a part."""
    return folder / f"part-{index:05d}.parquet"


def write_part(path: Path, rows: list[Row]) -> None:
    """Write rows under a temporary name, then move them into place, so that a part is whole or absent."""
    columns: dict[str, list[Any]] = {name: [] for name in SCHEMA.names}
    for row in rows:
        color, height, valid = encode_heightmap(row.heightmap)
        which = (row.task, row.split, row.seed, row.episode, row.step)
        values = (*which, color, height, valid, [asdict(d) for d in row.demos])
        for name, value in zip(SCHEMA.names, values, strict=True):
            columns[name].append(value)
    temporary = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    try:
        pq.write_table(pa.table(columns, schema=SCHEMA), temporary, compression="none", row_group_size=64)
        temporary.replace(path)
    except OSError as error:
        raise DataError(f"cannot write {path}: {error.strerror or error}") from error
    finally:
        temporary.unlink(missing_ok=True)


def read_part(path: Path, workspace: WorkspaceSpec) -> list[Row]:
    """The rows of a part.

    Raises:
        DataError: when the file is absent or not a part.
    """
    try:
        records = pq.read_table(path, schema=SCHEMA).to_pylist()
    except (OSError, pa.ArrowException) as error:
        reason = str(error).splitlines()[0]
        raise DataError(f"cannot read {path}: {reason}; generate it again") from error
    return [
        Row(
            r["task"],
            r["split"],
            r["seed"],
            r["episode"],
            r["step"],
            decode_heightmap(r["color_png"], r["height_png"], r["valid_png"], workspace),
            tuple(Demo(**d) for d in r["demos"]),
        )
        for r in records
    ]


def encode_heightmap(heightmap: Heightmap) -> tuple[bytes, bytes, bytes]:
    """PNGs of colour (RGB, 7 bits a channel), of height (16 bit, HEIGHT_UNIT above z_min) and of validity (1 bit)."""
    steps = np.rint((heightmap.height - heightmap.workspace.z_min) / HEIGHT_UNIT)
    height = np.clip(steps, 0, 65535).astype(np.uint16)
    valid = heightmap.valid.astype(np.uint8) * 255
    return (
        _png(cv2.cvtColor(heightmap.color & _COLOR_BITS, cv2.COLOR_RGB2BGR), _COLOR_PNG),
        _png(height, _HEIGHT_PNG),
        _png(valid, [cv2.IMWRITE_PNG_COMPRESSION, 9, cv2.IMWRITE_PNG_BILEVEL, 1]),
    )


def decode_heightmap(color: bytes, height: bytes, valid: bytes, workspace: WorkspaceSpec) -> Heightmap:
    """The inverse of `encode_heightmap`, heights to within half a HEIGHT_UNIT, colours to within 1."""
    rgb = cv2.cvtColor(_image(color, cv2.IMREAD_COLOR), cv2.COLOR_BGR2RGB)
    mask = _image(valid, cv2.IMREAD_GRAYSCALE) > 0
    metres = _image(height, cv2.IMREAD_UNCHANGED).astype(np.float32) * np.float32(HEIGHT_UNIT)
    metres = np.where(mask, metres + np.float32(workspace.z_min), np.float32(0.0)).astype(np.float32)
    return Heightmap(rgb.astype(np.uint8), metres, mask, workspace)


def _png(image: npt.NDArray[Any], options: list[int]) -> bytes:
    done, data = cv2.imencode(".png", image, options)
    if not done:
        raise DataError("an image could not be encoded as PNG")
    return bytes(data)


def _image(data: bytes, flags: int) -> npt.NDArray[Any]:
    image = cv2.imdecode(np.frombuffer(data, dtype=np.uint8), flags)
    if image is None:
        raise DataError("an image in the data set is no readable PNG; generate that part again")
    result: npt.NDArray[Any] = image
    return result
