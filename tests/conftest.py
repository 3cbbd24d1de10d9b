"""What tests of the whole workspace share."""

from __future__ import annotations

import os
import signal
import subprocess
from collections.abc import Mapping
from pathlib import Path
from typing import Protocol
from unittest import mock

import pytest
from ros2cli_small.main import main


class Ros2Here(Protocol):
    """Runs a `ros2` command to its end, in this environment or in another."""

    def __call__(
        self, *arguments: str | Path, environment: Mapping[str, str] | None = None
    ) -> subprocess.CompletedProcess[str]: ...


@pytest.fixture
def ros2_here(capfd: pytest.CaptureFixture[str]) -> Ros2Here:
    """Run `ros2` commands within this process, which has imported what each process of its own would have to.

    A command that raises what it should have told of in one line fails the test.
    """

    def run(*arguments: str | Path, environment: Mapping[str, str] | None = None) -> subprocess.CompletedProcess[str]:
        capfd.readouterr()  # what came before is not the command's
        command = [str(argument) for argument in arguments]
        handlers = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
        try:
            with mock.patch.dict(os.environ, environment or os.environ, clear=True):
                status = main(command)
        except SystemExit as exit_of_parser:
            status = int(exit_of_parser.code or 0)
        finally:
            for number, handler in handlers.items():
                signal.signal(number, handler)
        return subprocess.CompletedProcess(command, status, *capfd.readouterr())

    return run
