"""`cliport_policy learn` as a process of its own, and what it says as it goes on."""

from __future__ import annotations

import json
import shutil
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from demo_tool.errors import NotNowError
from demo_tool.line_process import LineProcess
from demo_tool.ports import OnLessonEnd, OnLine

LEARN = (sys.executable, "-m", "cliport_policy.learn")
_NICE = ("nice", "-n", "10")  # the arm and the page come first
_PATIENCE = 20.0  # in which a stopped training is saved [s]


class LessonProcess:
    """One lesson at a time; a stopped one goes on where it was when it is begun again.

    folder: for what is learned, in a folder for each data set; old: a training set of what the policy knows already, so
    that it is not forgotten; command: what learns, with the options of `ros2 run cliport_policy learn`.
    """

    def __init__(self, folder: Path, old: Path | None = None, command: Sequence[str] = LEARN) -> None:
        self._folder, self._old, self._command = folder, old, command
        self._process = LineProcess("learning", _PATIENCE)

    def begin(self, data_set: Path, options: Sequence[str], on_line: OnLine, on_end: OnLessonEnd) -> None:
        """Learn from the episodes of a data set's folder with options; on_line and on_end are called in another thread.

        Raises:
            NotNowError: when the process cannot be started.
        """
        report = Path(tempfile.mkdtemp(prefix="lesson-")) / "report.json"
        words = ["--from-bags", str(data_set), "--out", str(self._folder / data_set.name), "--report", str(report)]
        words += [*options, *([] if self._old is None else ["--old", str(self._old)])]

        def end(status: int) -> None:
            try:
                found = json.loads(report.read_text(encoding="utf-8"))
            except (OSError, ValueError):
                found = None
            shutil.rmtree(report.parent, ignore_errors=True)
            on_end(status, found if isinstance(found, dict) else None)

        try:
            self._process.begin([*_NICE, *self._command, *words], on_line, end)
        except NotNowError:
            report.parent.rmdir()
            raise

    def stop(self) -> None:
        """Let it save what it has learned and end; does not wait."""
        self._process.stop()

    def close(self) -> None:
        """Stop, and wait until it has ended."""
        self._process.close()
