"""The `rosbags` library, which has no caps of its own, with those of `bag_limits`; tools may take this module too."""

from __future__ import annotations

import shutil
import tempfile
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import rosbags.rosbag2.metadata as bag_metadata
import rosbags.rosbag2.reader as bag_reader
import rosbags.rosbag2.storage_mcap as bag_mcap
from backports import zstd
from rosbags.rosbag2 import Reader
from ruamel.yaml import YAML

from cliport_core import bag_limits
from cliport_core.bag_limits import TooMuchError
from cliport_core.errors import CoreError

_COPIED_AT_ONCE = 1 << 16  # bytes


def open_reader(path: Path) -> Reader:
    """Open a bag's folder or one of its files; the reader is to be closed.

    Raises:
        TooMuchError: when it declares or holds more than it may.
        Exception: the library does not say what a damaged file may raise.
    """
    _guard_library()
    for file in path.iterdir() if path.is_dir() else [path]:
        if file.is_file():
            bag_limits.check_file(file)
    reader = Reader(path)
    reader.open()
    try:
        for storage in getattr(reader.storage, "storages", [reader.storage]):
            bag_limits.check_overlap(getattr(storage, "chunks", ()))
    except BaseException:
        reader.close()
        raise
    return reader


def _guard_library() -> None:
    """Put the caps into the library: its decompressors and its YAML."""
    bag_mcap.DECOMPRESSORS.update({"zstd": bag_limits.decompress_zstd, "lz4": bag_limits.decompress_lz4})
    replacements: tuple[tuple[ModuleType, str, Any], ...] = (
        (bag_metadata, "YAML", _PlainYaml),
        (bag_reader, "YAML", _PlainYaml),
        (bag_reader, "zstd", SimpleNamespace(decompress=bag_limits.decompress_message, open=_BoundedFile)),
    )
    for module, name, replacement in replacements:
        if not hasattr(module, name):
            raise CoreError(f"the library 'rosbags' has changed: {module.__name__} has no {name} to put caps on")
        setattr(module, name, replacement)


class _PlainYaml(YAML):  # type: ignore[misc]
    """The library's YAML without aliases."""

    def load(self, stream: Any) -> Any:
        bag_limits.check_yaml(str(stream))
        return super().load(stream)


class _BoundedFile(zstd.ZstdFile):
    """A compressed storage file on its way to the temporary folder, which it may fill by half."""

    def __init__(self, file: Any, _mode: str) -> None:
        super().__init__(file)
        self._left = shutil.disk_usage(tempfile.gettempdir()).free // 2

    def read(self, size: int | None = -1) -> bytes:
        data: bytes = super().read(_COPIED_AT_ONCE if size is None or size < 0 else size)
        self._left -= len(data)
        if self._left < 0:
            raise TooMuchError(f"its files need more than half of the free space in '{tempfile.gettempdir()}'")
        return data
