"""`cliport_perception calibrate` as a process of its own; it ends with this one, and the hand's motion with it."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from pathlib import Path

from demo_tool.line_process import LineProcess
from demo_tool.ports import OnLine

CALIBRATE = (sys.executable, "-m", "cliport_perception.calibration.cli")
_PATIENCE = 10.0  # in which a stopped one has to end [s]
_OWN_NAMES = ("__node:=", "__name:=", "__ns:=")  # remappings of this process's node that are not meant for another


class CalibrationProcess:
    """One calibration at a time.

    out: the file that it writes; robot: the preset whose frames are meant; ros_arguments: from `--ros-args` on, with
    which this program was started: the camera's topics are the same.
    """

    def __init__(
        self, out: Path, robot: str, ros_arguments: Sequence[str] = (), command: Sequence[str] = CALIBRATE
    ) -> None:
        self._fixed = ("--out", str(out), "--robot", robot, "--tied")
        self._ros = shared_arguments(ros_arguments)
        self._command = command
        self._process = LineProcess("the calibration", _PATIENCE)

    def begin(self, options: Sequence[str], on_line: OnLine, on_end: Callable[[int], None]) -> None:
        """Calibrate with options of `calibrate`; callbacks come from another thread. Raises NotNowError."""
        self._process.begin([*self._command, *options, *self._fixed, *self._ros], on_line, on_end)

    def stop(self) -> None:
        """End it, with nothing saved; does not wait."""
        self._process.stop()

    def close(self) -> None:
        """Stop, and wait until it has ended."""
        self._process.close()


def shared_arguments(arguments: Sequence[str]) -> list[str]:
    """Return ROS arguments without the remappings of the node's own name."""
    kept: list[str] = []
    for argument in arguments:
        if argument.startswith(_OWN_NAMES):
            if kept and kept[-1] in ("-r", "--remap"):
                kept.pop()
            continue
        kept.append(argument)
    return kept
