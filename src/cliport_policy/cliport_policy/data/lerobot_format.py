"""LeRobot's dataset format, version 3.0: the files of a data set without videos, and what ours adds.

`meta/info.json` describes the columns, `meta/tasks.parquet` the sentences, `meta/episodes` the episodes,
`meta/stats.json` means and ranges, `data` has a row a step. `cliport` beside them holds what LeRobot has no column for
and the way back to bags needs.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from cliport_policy.errors import DataError

VERSION = "v3.0"
FILE = "chunk-000/file-{:03d}.parquet"
DATA = "data/" + FILE
EPISODES = "meta/episodes/" + FILE
INFO, TASKS, STATS = "meta/info.json", "meta/tasks.parquet", "meta/stats.json"
STEPS, SETUP = "cliport/steps.parquet", "cliport/setup.json"
COLOR, STATE, ACTION = "observation.images.color", "observation.state", "action"
ACTION_NAMES = ("pick_x", "pick_y", "pick_yaw", "place_x", "place_y", "place_yaw", "primitive")
FPS = 1  # steps have no rate; LeRobot's columns need one
FINAL = -1  # in place of a step's number, for the scene after the last one
_CHUNK, _DATA_MB, _VIDEO_MB = 1000, 100, 200

IMAGE = pa.struct([("bytes", pa.binary()), ("path", pa.string())])
COUNTERS = {"timestamp": "float32", **dict.fromkeys(("frame_index", "episode_index", "index", "task_index"), "int64")}
OWN_SCHEMA = pa.schema(
    {
        "episode_index": pa.int64(),
        "step": pa.int64(),
        "demonstration": pa.binary(),  # the message of /cliport/demonstration, CDR; none in the scene after the last
        "depth": pa.binary(),  # PNG of uint16 millimetres, 0 where unknown
        "color": pa.binary(),  # PNG of the scene after the last step, which has no row in `data`
        "seen": pa.string(),  # JSON: stamp, joints, camera and its pose
    }
)


def data_schema(joints: int) -> pa.Schema:
    """Return the columns of `data`, for a state of so many joints; the format has one value as a number, not a list."""
    return pa.schema(
        {
            COLOR: IMAGE,
            STATE: pa.list_(pa.float32(), joints) if joints > 1 else pa.float32(),
            ACTION: pa.list_(pa.float32(), len(ACTION_NAMES)),
            **{name: pa.type_for_alias(kind) for name, kind in COUNTERS.items()},
        }
    )


def info_of(
    height: int, width: int, joints: Sequence[str], episodes: int, frames: int, tasks: int, robot: str
) -> dict[str, Any]:
    """Return what `meta/info.json` holds; height, width [pixels] of the pictures; joints: names of the state."""
    numbers = {name: {"dtype": kind, "shape": [1], "names": None} for name, kind in COUNTERS.items()}
    return {
        "codebase_version": VERSION,
        "robot_type": robot,
        "total_episodes": episodes,
        "total_frames": frames,
        "total_tasks": tasks,
        "chunks_size": _CHUNK,
        "data_files_size_in_mb": _DATA_MB,
        "video_files_size_in_mb": _VIDEO_MB,
        "fps": FPS,
        "splits": {"train": f"0:{episodes}"},
        "data_path": "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet",
        "video_path": None,
        "features": {
            COLOR: {"dtype": "image", "shape": [height, width, 3], "names": ["height", "width", "channels"]},
            STATE: {"dtype": "float32", "shape": [len(joints)], "names": list(joints)},
            ACTION: {"dtype": "float32", "shape": [len(ACTION_NAMES)], "names": list(ACTION_NAMES)},
            **numbers,
        },
    }


def write_tasks(path: Path, sentences: Sequence[str]) -> None:
    """Write the sentences as pandas would a frame that has them as its index: LeRobot reads them with pandas."""
    index = "__index_level_0__"

    def column(name: str | None, field: str, kind: str, numpy: str) -> dict[str, Any]:
        return {"name": name, "field_name": field, "pandas_type": kind, "numpy_type": numpy, "metadata": None}

    meaning = {
        "index_columns": [index],
        "column_indexes": [column(None, "None", "unicode", "object") | {"field_name": None}],
        "columns": [column("task_index", "task_index", "int64", "int64"), column(None, index, "unicode", "object")],
        "pandas_version": "2.2.0",
    }
    table = pa.table(
        {"task_index": pa.array(range(len(sentences)), pa.int64()), index: pa.array(sentences, pa.string())}
    )
    pq.write_table(table.replace_schema_metadata({"pandas": json.dumps(meaning)}), path)


def read_tasks(path: Path) -> dict[int, str]:
    """Return the sentences by their numbers, of any column that holds texts. Raises DataError where there is none."""
    table = pq.read_table(path)
    texts = [name for name in table.column_names if pa.types.is_string(table.schema.field(name).type)]
    if "task_index" not in table.column_names or not texts:
        raise DataError(f"{path} lists no sentences: it needs the columns task_index and one of texts")
    return dict(zip(table["task_index"].to_pylist(), table[texts[0]].to_pylist(), strict=True))


class Statistics:
    """Means, deviations and ranges of the columns, as `meta/stats.json` has them; pictures by channel in 0..1."""

    def __init__(self) -> None:
        self._sums: dict[str, list[np.ndarray]] = {}
        self._counts: dict[str, int] = {}
        self._rows: dict[str, int] = {}

    def add(self, name: str, values: Any, axes: tuple[int, ...] = ()) -> None:
        """Count a row's value; axes: those over which a picture's values are taken together."""
        array = np.atleast_1d(np.asarray(values, np.float64))
        count = math.prod(array.shape[axis] for axis in axes)
        parts = [array.sum(axes), np.square(array).sum(axes), array.min(axes), array.max(axes)]
        if name in self._sums:
            joins = (np.add, np.add, np.minimum, np.maximum)
            parts = [join(old, new) for join, old, new in zip(joins, self._sums[name], parts, strict=True)]
        self._sums[name] = parts
        self._counts[name] = self._counts.get(name, 0) + count
        self._rows[name] = self._rows.get(name, 0) + 1

    def to_dict(self) -> dict[str, Mapping[str, Any]]:
        """Return plain values, ready for JSON."""
        found: dict[str, Mapping[str, Any]] = {}
        for name, (total, squares, least, most) in self._sums.items():
            count = self._counts[name]
            mean = total / count
            deviation = np.sqrt(np.maximum(squares / count - mean**2, 0.0))
            shaped = {"min": least, "max": most, "mean": mean, "std": deviation}
            picture = count > self._rows[name]
            found[name] = {
                **{key: (value[:, None, None] if picture else value).tolist() for key, value in shaped.items()},
                "count": [self._rows[name]],
            }
        return found
