"""Encoded images of a data set's rows, read by row group and remembered up to a number of bytes."""

from __future__ import annotations

import threading
from collections import OrderedDict
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import pyarrow as pa
import pyarrow.parquet as pq

from cliport_policy.errors import DataError

IMAGES = ("color_png", "height_png", "valid_png")


class Place(NamedTuple):
    """Position of a row: number of the part, row group within it, row within that."""

    part: int
    group: int
    row: int


class EncodedRows:
    """Random access to the rows of Parquet parts, with a cache.

    Threads may read at once; what was used least recently is forgotten first.
    """

    def __init__(self, parts: Sequence[Path], cache_bytes: int) -> None:
        self._parts, self._limit = list(parts), cache_bytes
        self._groups: OrderedDict[tuple[int, int], pa.Table] = OrderedDict()
        self._bytes = 0
        self._lock = threading.Lock()

    @property
    def cached_bytes(self) -> int:
        """Size of the cache's content."""
        return self._bytes

    def read(self, place: Place) -> tuple[Any, ...]:
        """Return a row's IMAGES as buffers of PNG.

        Raises:
            DataError: naming the file, if it can't be read.
        """
        table = self._group(place.part, place.group)
        return tuple(table.column(name)[place.row].as_buffer() for name in IMAGES)

    def _group(self, part: int, group: int) -> pa.Table:
        key = part, group
        with self._lock:
            if key in self._groups:
                self._groups.move_to_end(key)
                return self._groups[key]
        table = self._load(part, group)
        with self._lock:
            if key not in self._groups:
                self._groups[key] = table
                self._bytes += table.nbytes
            while self._bytes > self._limit and len(self._groups) > 1:
                self._bytes -= self._groups.popitem(last=False)[1].nbytes
        return table

    def _load(self, part: int, group: int) -> pa.Table:
        path = self._parts[part]
        try:
            with pq.ParquetFile(path) as file:
                return file.read_row_group(group, list(IMAGES), use_threads=False)
        except (OSError, IndexError, KeyError, pa.ArrowException) as error:
            reason = " ".join(str(error).split())[:160]
            raise DataError(f"{path} can't be read ({reason}): delete it and run generate again") from error
