"""A file is replaced as a whole, or stays as it was."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from cliport_core import whole_file as module
from cliport_core.whole_file import UNFINISHED, whole_file


def test_a_file_is_there_once_it_is_whole_and_on_the_disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "text.json"
    path.write_text("old")
    done: list[str] = []
    replace = os.replace
    monkeypatch.setattr(module, "sync", lambda path: done.append(path.name))
    monkeypatch.setattr(module.os, "replace", lambda old, new: (done.append("replace"), replace(old, new)))
    with whole_file(path) as temporary:
        temporary.write_text("new")
        assert path.read_text() == "old" and temporary.name.startswith(".text.json.") and temporary.suffix == UNFINISHED
    assert path.read_text() == "new" and done == [temporary.name, "replace", tmp_path.name]
    assert list(path.parent.iterdir()) == [path]


@pytest.mark.parametrize("error", [OSError("no space left"), ValueError("of the block"), KeyboardInterrupt()])
def test_whatever_fails_the_old_file_stays_and_nothing_is_left(tmp_path: Path, error: BaseException) -> None:
    path = tmp_path / "text"
    path.write_text("old")
    with pytest.raises(type(error)), whole_file(path) as temporary:
        _write_half(temporary, error)
    assert [(found.name, found.read_text()) for found in tmp_path.iterdir()] == [("text", "old")]


def _write_half(path: Path, error: BaseException) -> None:
    path.write_text("ne")
    raise error


def test_a_file_that_cannot_be_put_on_the_disk_does_not_replace_the_old_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(number: int) -> None:
        raise OSError("no space left")

    path = tmp_path / "text"
    path.write_text("old")
    monkeypatch.setattr(module.os, "fsync", refuse)
    with pytest.raises(OSError, match="no space left"), whole_file(path) as temporary:
        temporary.write_text("new")
    assert [(found.name, found.read_text()) for found in tmp_path.iterdir()] == [("text", "old")]


def test_two_writers_at_once_do_not_meet(tmp_path: Path) -> None:
    path = tmp_path / "text"
    with whole_file(path) as first, whole_file(path) as second:
        first.write_text("1")
        second.write_text("2")
        assert first != second
    assert path.read_text() == "1", "the outer one ends last"
