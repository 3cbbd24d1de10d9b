from __future__ import annotations

import os
from pathlib import Path

import pytest

from cliport_episodes import disk
from cliport_episodes.errors import DiskError, SetupDiffersError


def test_a_copied_folder_is_on_the_disk_before_it_has_its_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Else a power cut could leave a folder of that name without its files."""
    source, target = tmp_path / "source", tmp_path / "target"
    source.mkdir()
    (source / "a").write_text("a")
    (source / ".hidden").write_text("b")
    done: list[tuple[str, str]] = []
    rename = os.rename
    monkeypatch.setattr(disk, "sync", lambda path: done.append(("sync", path.name)))
    monkeypatch.setattr(disk.os, "rename", lambda old, new: (done.append(("rename", Path(new).name)), rename(old, new)))
    disk.copy_folder(source, target)
    new = done[0][1]
    assert done == [("sync", new), ("rename", "target"), ("sync", tmp_path.name)]
    assert new.startswith(".target")
    assert [path.name for path in target.iterdir()] == ["a"]


def test_a_copy_that_fails_leaves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    source = tmp_path / "source"
    source.mkdir()
    (source / "a").write_text("a")

    def refuse(path: Path) -> None:
        raise OSError("no space left")

    monkeypatch.setattr(disk, "sync", refuse)
    with pytest.raises(OSError, match="no space left"):
        disk.copy_folder(source, tmp_path / "target")
    assert [path.name for path in tmp_path.iterdir()] == ["source"]


def test_a_text_that_cannot_be_replaced_stays_and_leaves_nothing_beside_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "text"
    path.write_text("old")

    def refuse(number: int) -> None:
        raise OSError("no space left")

    monkeypatch.setattr(disk.os, "fsync", refuse)
    with pytest.raises(OSError, match="no space left"):
        disk.replace_text(path, "new")
    assert [(found.name, found.read_text()) for found in tmp_path.iterdir()] == [("text", "old")]


def test_another_setup_is_named_with_its_differences() -> None:
    error = SetupDiffersError("mine", ["fx is 60, not 61", "height is 48, not 96"])
    assert error.differences == ("fx is 60, not 61", "height is 48, not 96")
    assert str(error) == (
        "data set 'mine' was recorded with another setup: fx is 60, not 61; height is 48, not 96. Begin a new data set"
    )


def test_files_that_cannot_be_linked_are_copied_and_on_the_disk(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    source = tmp_path / "source"
    source.mkdir()
    (source / "a").write_text("a")
    synced: list[str] = []

    def refuse(old: Path, new: Path) -> None:
        raise OSError("links are not supported here")

    monkeypatch.setattr(disk.os, "link", refuse)
    monkeypatch.setattr(disk, "sync", lambda path: synced.append(path.name))
    disk.copy_folder(source, tmp_path / "target")
    assert (tmp_path / "target" / "a").read_text() == "a"
    assert synced[0] == "a" and len(synced) == 3


def test_a_disks_error_carries_the_path() -> None:
    error = DiskError(Path("/data/a"), "no space left", "Free some.")
    assert error.path == Path("/data/a")
    assert str(error) == "cannot write '/data/a': no space left. What was saved before is whole. Free some."
