"""A commit alone says nothing of files that differ from it or were never added."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

from cliport_core.source_state import source_state


@pytest.fixture
def checkout(tmp_path: Path) -> Path:
    (tmp_path / "src").mkdir()
    (tmp_path / "src" / "a.py").write_text("x = 1\n")
    (tmp_path / ".gitignore").write_text("*.log\n")
    for words in (
        ["init", "-q"],
        ["add", "."],
        ["-c", "user.name=n", "-c", "user.email=n@example.invalid", "commit", "-qm", "x"],
    ):
        subprocess.run(["git", "-C", str(tmp_path), *words], check=True)
    return tmp_path


def test_a_clean_checkout_is_its_commit(checkout: Path) -> None:
    state = source_state(checkout / "src")
    assert not state.dirty and len(state.commit) == 40 and str(state) == state.commit
    (checkout / "src" / "run.log").touch()  # ignored
    (checkout / "results.json").touch()  # no source
    assert source_state(checkout / "src") == state


@pytest.mark.parametrize(("name", "text"), [("a.py", "x = 2\n"), ("b.py", "y = 1\n")], ids=["changed", "untracked"])
def test_a_changed_or_untracked_source_file_is_told(checkout: Path, name: str, text: str) -> None:
    (checkout / "src" / name).write_text(text)
    state = source_state(checkout / "src")
    assert state.dirty and str(state) == state.commit + "+changes"
    assert state.to_dict() == {"commit": str(state), "dirty": True}


def test_outside_a_checkout_nobody_can_tell(tmp_path: Path) -> None:
    state = source_state(tmp_path)
    assert (str(state), state.dirty) == ("unknown", True)
