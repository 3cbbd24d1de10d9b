"""`cliport_policy learn` as a process of its own, and what it says as it goes on."""

from __future__ import annotations

import json
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
from collections.abc import Sequence
from pathlib import Path

from demo_tool.errors import NotNowError
from demo_tool.ports import OnLessonEnd, OnLine

LEARN = (sys.executable, "-m", "cliport_policy.learn")
_NICE = ("nice", "-n", "10")  # the arm and the page come first
_PATIENCE = 20.0  # in which a stopped training is saved [s]
_WIDEST = 300  # characters of a line


class LessonProcess:
    """One lesson at a time; a stopped one goes on where it was when it is begun again.

    folder: for what is learned, in a folder for each data set; command: what learns, with the options of
    `ros2 run cliport_policy learn`.
    """

    def __init__(self, folder: Path, command: Sequence[str] = LEARN) -> None:
        self._folder, self._command = folder, command
        self._process: subprocess.Popen[str] | None = None
        self._reader: threading.Thread | None = None

    def begin(self, data_set: Path, on_line: OnLine, on_end: OnLessonEnd) -> None:
        """Learn from the episodes of a data set's folder; on_line and on_end are called in another thread.

        Raises:
            NotNowError: when the process cannot be started.
        """
        report = Path(tempfile.mkdtemp(prefix="lesson-")) / "report.json"
        words = ["--from-bags", str(data_set), "--out", str(self._folder / data_set.name), "--report", str(report)]
        try:
            self._process = subprocess.Popen(
                [*_NICE, *self._command, *words],
                stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, errors="replace",
                start_new_session=True,
            )  # fmt: skip
        except OSError as error:
            report.parent.rmdir()
            raise NotNowError(f"learning cannot be started: {error.strerror}") from error
        arguments = (self._process, report, on_line, on_end)
        self._reader = threading.Thread(target=_follow, args=arguments, name="lesson", daemon=True)
        self._reader.start()

    def stop(self) -> None:
        """Let it save what it has learned and end; does not wait."""
        if self._process is not None and self._process.poll() is None:
            self._process.send_signal(signal.SIGINT)

    def close(self) -> None:
        """Stop, and wait until it has ended."""
        self.stop()
        if self._process is None or self._reader is None:
            return
        try:
            self._process.wait(_PATIENCE)
        except subprocess.TimeoutExpired:
            self._process.kill()
        self._reader.join(_PATIENCE)


def _follow(process: subprocess.Popen[str], report: Path, on_line: OnLine, on_end: OnLessonEnd) -> None:
    """Hand on each line, then the end."""
    assert process.stdout is not None
    with process.stdout as lines:
        for line in lines:
            if line.strip():
                on_line(line.strip()[:_WIDEST])
    status = process.wait()
    try:
        found = json.loads(report.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        found = None
    shutil.rmtree(report.parent, ignore_errors=True)
    on_end(status, found if isinstance(found, dict) else None)
