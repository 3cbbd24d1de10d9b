"""A process that learns: its lines, its report, its end, and a stop."""

from __future__ import annotations

import sys
import threading
from pathlib import Path
from typing import Any

import pytest

from demo_tool.errors import NotNowError
from demo_tool.lesson_process import LessonProcess

LEARNS = """
import json, sys
given = dict(zip(sys.argv[1::2], sys.argv[2::2]))
print("learning", given["--from-bags"], "into", given["--out"], given["--minutes"], given["--old"], flush=True)
print()
print("a warning", file=sys.stderr, flush=True)
with open(given["--report"], "w") as file:
    json.dump({"policy": given["--out"]}, file)
"""
WAITS = """
import time
try:
    print("begun", flush=True)
    time.sleep(60)
except KeyboardInterrupt:
    print("saved", flush=True)
    raise SystemExit(130)
"""


class Heard:
    """What a process says, and its end."""

    def __init__(self) -> None:
        self.lines: list[str] = []
        self.ends: list[tuple[int, dict[str, Any] | None]] = []
        self.spoke, self.ended = threading.Event(), threading.Event()

    def on_line(self, line: str) -> None:
        self.lines.append(line)
        self.spoke.set()

    def on_end(self, status: int, report: dict[str, Any] | None) -> None:
        self.ends.append((status, report))
        self.ended.set()


def begun(script: str, tmp_path: Path) -> tuple[LessonProcess, Heard]:
    process, heard = LessonProcess(tmp_path / "learned", tmp_path / "old", (sys.executable, "-c", script)), Heard()
    process.begin(tmp_path / "sets" / "mine", ["--minutes", "7"], heard.on_line, heard.on_end)
    return process, heard


def test_lines_and_the_report_are_handed_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    _, heard = begun(LEARNS, tmp_path)
    assert heard.ended.wait(60)
    assert heard.lines == [f"learning {tmp_path}/sets/mine into {tmp_path}/learned/mine 7 {tmp_path}/old", "a warning"]
    assert heard.ends == [(0, {"policy": f"{tmp_path}/learned/mine"})]
    assert not list(tmp_path.glob("lesson-*")), "nothing is left behind"


def test_what_a_process_leaves_beside_its_report_is_removed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As a report that was half written when its process was killed."""
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    _, heard = begun(LEARNS + 'open(given["--report"] + ".tmp", "w").close()', tmp_path)
    assert heard.ended.wait(60)
    assert heard.ends == [(0, {"policy": f"{tmp_path}/learned/mine"})] and not list(tmp_path.glob("lesson-*"))


@pytest.mark.parametrize("script", ["raise SystemExit(1)", LEARNS.replace("json.dump({", "file.write('[]') or ({")])
def test_without_a_report_there_is_none(script: str, tmp_path: Path) -> None:
    _, heard = begun(script, tmp_path)
    assert heard.ended.wait(60)
    assert heard.ends[0][1] is None


def test_a_stopped_process_ends_by_itself_and_close_waits(tmp_path: Path) -> None:
    process, heard = begun(WAITS, tmp_path)
    assert heard.spoke.wait(60)
    process.close()
    assert heard.lines == ["begun", "saved"] and heard.ends == [(130, None)]
    process.stop()
    process.close()
    LessonProcess(tmp_path).close()


def test_what_cannot_be_started_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(NotNowError, match="learning cannot be started: No such file or directory"):
        LessonProcess(tmp_path).begin(tmp_path, [], lambda _: None, lambda *_: None)
    assert not list(tmp_path.glob("lesson-*"))
