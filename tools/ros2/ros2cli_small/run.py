"""ros2 run: start one executable of a package and take over its exit status."""

from __future__ import annotations

import argparse
import shlex
import signal
import subprocess
from contextlib import suppress
from types import FrameType
from typing import Any

from ros2cli_small.packages import find_executable

MESSAGE_PREFIX = "[ros2run]:"
FORWARDED = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT)
_HEARD_S = 0.2


def add_parser(commands: Any) -> None:
    """Add `run` to the command line."""
    parser = commands.add_parser("run", help="Run a package specific executable")
    parser.add_argument("--prefix", help="Prefix command, which should go before the executable")
    parser.add_argument("package_name", help="Name of the ROS package")
    parser.add_argument("executable_name", help="Name of the executable")
    parser.add_argument("argv", nargs=argparse.REMAINDER, help="Pass arbitrary arguments to the executable")
    parser.set_defaults(main=main)


def main(args: argparse.Namespace) -> int:
    """Run the executable; signals to us go on to it."""
    command = [str(find_executable(args.package_name, args.executable_name)), *args.argv]
    if args.prefix:
        command = shlex.split(args.prefix) + command
    return run_forwarding_signals(command)


def run_forwarding_signals(command: list[str]) -> int:
    """Run a command to its end, forwarding signals, and say when it failed. Returns its return code."""
    process: subprocess.Popen[bytes] | None = None
    early: list[int] = []

    def forward(number: int, _frame: FrameType | None) -> None:
        if process is None:
            early.append(number)
        elif process.poll() is None:
            process.send_signal(number)

    for number in FORWARDED:
        signal.signal(number, forward)
    process = subprocess.Popen(command)
    for missed in early:
        process.send_signal(missed)
    while (code := process.poll()) is None:
        with suppress(subprocess.TimeoutExpired):
            process.wait(_HEARD_S)  # a signal that comes just before a wait is heard after it
    if code < 0:
        print(MESSAGE_PREFIX, signal.Signals(-code).name)
    elif code > 0:
        print(MESSAGE_PREFIX, "Process exited with failure", code)
    return code
