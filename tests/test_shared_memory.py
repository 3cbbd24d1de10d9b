"""Whether a file of shared memory counts as used."""

import mmap
import os
from collections.abc import Iterator
from pathlib import Path

import pytest
from shared_memory import SHARED, is_used, shared_files


@pytest.fixture
def file() -> Iterator[Path]:
    path = SHARED / f"test_shared_memory_{os.getpid()}"
    path.write_bytes(bytes(mmap.PAGESIZE))
    yield path
    path.unlink()


def test_what_nobody_holds_is_left_over(file: Path):
    assert file.name in shared_files() and not is_used(file.name)


def test_what_this_process_has_open_is_used(file: Path):
    with file.open("rb"):
        assert is_used(file.name)
    assert not is_used(file.name)


def test_what_is_mapped_alone_is_used(file: Path):
    with file.open("r+b") as opened:
        memory = mmap.mmap(opened.fileno(), 0)
    assert is_used(file.name)
    memory.close()
    assert not is_used(file.name)


def test_a_mutex_is_used_as_long_as_its_port(file: Path):
    mutex = f"sem.{file.name}_mutex"
    with file.open("rb"):
        assert is_used(mutex)
    assert not is_used(mutex)
