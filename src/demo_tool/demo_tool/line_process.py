"""A process of its own whose lines are handed on as they come, and then its end."""

from __future__ import annotations

import signal
import subprocess
import threading
from collections.abc import Callable, Sequence

from demo_tool.errors import NotNowError
from demo_tool.ports import OnLine

_WIDEST = 300  # characters of a line


class LineProcess:
    """One process at a time; its standard input stays open until it is told to end, or this process is gone.

    name: of what it does, for words; patience: in which a stopped one has to end [s].
    """

    def __init__(self, name: str, patience: float) -> None:
        self._name, self._patience = name, patience
        self._process: subprocess.Popen[str] | None = None
        self._reader: threading.Thread | None = None

    def begin(self, command: Sequence[str], on_line: OnLine, on_end: Callable[[int], None]) -> None:
        """Start a command; on_line is told each line of both outputs, on_end the exit status, in another thread.

        Raises:
            NotNowError: when the process cannot be started.
        """
        try:
            self._process = subprocess.Popen(
                list(command),
                stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, errors="replace",
                start_new_session=True,
            )  # fmt: skip
        except OSError as error:
            raise NotNowError(f"{self._name} cannot be started: {error.strerror}") from error
        arguments = (self._process, on_line, on_end)
        self._reader = threading.Thread(target=_follow, args=arguments, name=self._name, daemon=True)
        self._reader.start()

    def stop(self) -> None:
        """Ask it to end, as Ctrl+C does; does not wait."""
        if self._process is not None and self._process.poll() is None:
            self._process.send_signal(signal.SIGINT)

    def close(self) -> None:
        """Stop, and wait until it has ended."""
        self.stop()
        if self._process is None or self._reader is None:
            return
        try:
            self._process.wait(self._patience)
        except subprocess.TimeoutExpired:
            self._process.kill()
        self._reader.join(self._patience)


def _follow(process: subprocess.Popen[str], on_line: OnLine, on_end: Callable[[int], None]) -> None:
    """Hand on each line, then the end."""
    assert process.stdout is not None and process.stdin is not None
    with process.stdin, process.stdout as lines:
        for line in lines:
            if line.strip():
                on_line(line.strip()[:_WIDEST])
    on_end(process.wait())
