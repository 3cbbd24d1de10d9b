"""The executable `executor`: starts the node, and stops the arm before the process ends."""

from __future__ import annotations

import contextlib
import signal
import sys
import threading

import rclpy
from rclpy.exceptions import ParameterException
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.signals import SignalHandlerOptions

from cliport_perception.errors import PerceptionError
from panda_executor.errors import ExecutorError
from panda_executor.node import ExecutorNode


def main(args: list[str] | None = None) -> int:
    """Entry point; returns the exit status. SIGINT and SIGTERM cancel what runs before the process ends."""
    ended = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: ended.set())
    try:
        # rclpy's own handlers would shut the context down before the arm could be told to stop.
        rclpy.init(args=args, signal_handler_options=SignalHandlerOptions.NO)
        node = ExecutorNode()
    except (ExecutorError, PerceptionError, ParameterException) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    executor = SingleThreadedExecutor()  # goals have threads of their own
    executor.add_node(node)
    spinner = threading.Thread(target=_spin, args=(executor,), name="spin", daemon=True)
    spinner.start()
    while not ended.wait(0.2) and spinner.is_alive():
        pass
    node.close()
    executor.shutdown(timeout_sec=2.0)
    spinner.join(timeout=2.0)
    node.destroy_node()
    rclpy.try_shutdown()
    return 0


def _spin(executor: SingleThreadedExecutor) -> None:
    with contextlib.suppress(ExternalShutdownException):
        executor.spin()
