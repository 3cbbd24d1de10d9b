"""Running a node as a process: one line when it cannot start, a quiet end when it is asked to stop."""

from __future__ import annotations

import atexit
import signal
import sys
import threading
from collections.abc import Callable
from contextlib import suppress
from typing import TypeVar

import rclpy
from rclpy.exceptions import ParameterException
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

SIGNALS = (signal.SIGINT, signal.SIGTERM)
CLOSING_S = 2.0

N = TypeVar("N", bound=Node)
Fail = Callable[[BaseException], None]


def run_node(
    make_node: Callable[[Fail], N],
    errors: tuple[type[Exception], ...],
    args: list[str] | None = None,
    close: Callable[[N], None] | None = None,
) -> int:
    """Spin the node that `make_node` returns until SIGINT or SIGTERM; the exit status.

    :param make_node: is given a function to call, from any thread, with what went wrong beyond repair
    :param errors: what `make_node` may raise for bad settings: one line, status 1
    :param close: called while the node still spins, so that it can tell others before it goes
    """
    failures: list[BaseException] = []
    ended = threading.Event()
    for number in SIGNALS:
        signal.signal(number, lambda *_: ended.set())  # stays: a launcher often sends a second one
        atexit.register(signal.signal, number, signal.SIG_IGN)  # the interpreter's own end can take seconds

    def fail(error: BaseException) -> None:
        failures.append(error)
        ended.set()

    refusals: tuple[type[Exception], ...] = (*errors, ParameterException)
    try:
        # rclpy's own handlers would shut the context down before a node could say that it goes.
        rclpy.init(args=args, signal_handler_options=SignalHandlerOptions.NO)
        node = make_node(fail)
    except refusals as error:
        fail(error)
    else:
        _spin(node, ended, fail, close)
    rclpy.try_shutdown()
    for failure in failures:
        print(f"error: {' '.join(str(failure).split())}", file=sys.stderr)
    return 1 if failures else 0


def _spin(node: N, ended: threading.Event, fail: Fail, close: Callable[[N], None] | None) -> None:
    executor = SingleThreadedExecutor()  # what takes long has threads of its own
    executor.add_node(node)

    def spin() -> None:
        try:
            with suppress(ExternalShutdownException):
                executor.spin()
            ended.set()
        except Exception as error:  # a defect: the process must not stay behind without its callbacks
            fail(error)
            raise

    spinner = threading.Thread(target=spin, name="spin", daemon=True)
    spinner.start()
    ended.wait()
    if close:
        close(node)
    executor.shutdown(timeout_sec=CLOSING_S)
    spinner.join(timeout=CLOSING_S)
    node.destroy_node()
