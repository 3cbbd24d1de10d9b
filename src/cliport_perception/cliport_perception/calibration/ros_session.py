"""A short life with ROS: begun with the command line's ROS arguments, ended however the work ends."""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress

import rclpy
from rclpy.exceptions import ParameterException
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor

from cliport_core.throttle import MessageThrottle
from cliport_perception.calibration.procedures import Voice
from cliport_perception.errors import CalibrationError

_SAY_AGAIN_S = 5.0


def screen_voice() -> Voice:
    """Return words to the screen; complaints that only repeat themselves come once in a while."""
    throttle = MessageThrottle(_SAY_AGAIN_S)

    def say(words: str) -> None:
        print(words, flush=True)

    def complain(words: str) -> None:
        if throttle.passes(words, time.monotonic()):
            say(words)

    return Voice(say, complain)


def end_with_input() -> None:
    """Interrupt this process once its standard input has ended: whoever started it is gone."""

    def wait() -> None:
        with suppress(OSError):
            while os.read(sys.stdin.fileno(), 4096):
                pass
        os.kill(os.getpid(), signal.SIGINT)

    threading.Thread(target=wait, name="tied", daemon=True).start()


@contextmanager
def ros_session(ros_args: list[str]) -> Iterator[SingleThreadedExecutor]:
    """Give an executor; at the end it, its nodes and the context are gone.

    Raises:
        CalibrationError: for ROS arguments or parameters that cannot be understood.
        KeyboardInterrupt: when a signal has shut the context down.
    """
    try:
        rclpy.init(args=ros_args)
    except RuntimeError as error:
        reason = str(error).split(", at /")[0]  # where in its own sources is of no use here
        raise CalibrationError(f"{reason}; look at what follows --ros-args") from None
    executor = SingleThreadedExecutor()
    try:
        yield executor
    except ParameterException as error:
        raise CalibrationError(f"a parameter cannot be used: {error}") from None
    except ExternalShutdownException:
        raise KeyboardInterrupt from None
    finally:
        nodes = executor.get_nodes()
        executor.shutdown()
        for node in nodes:
            node.destroy_node()
        rclpy.try_shutdown()
