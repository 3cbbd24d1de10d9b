"""A node's life as a process: one line when it cannot start, a quiet end when it is asked to stop."""

from __future__ import annotations

import atexit
import signal
import sys
import threading
from collections.abc import Callable
from typing import TypeVar

import rclpy
from rclpy.context import Context
from rclpy.exceptions import ParameterException
from rclpy.executors import Executor, ExternalShutdownException
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

from cliport_core.errors import CoreError
from cliport_core.ros_executor import node_executor

SIGNALS = (signal.SIGINT, signal.SIGTERM)
CLOSING_S = 2.0
_HEARD_S = 0.2

N = TypeVar("N", bound=Node)
Fail = Callable[[BaseException], None]


def run_node(
    make_node: Callable[[Fail], N],
    errors: tuple[type[Exception], ...],
    args: list[str] | None = None,
    close: Callable[[N], None] | None = None,
) -> int:
    """Spin the node that `make_node` returns until SIGINT or SIGTERM; return the exit status.

    make_node: is given a function to call, from any thread, with what went wrong beyond repair.
    errors: what `make_node` may raise for bad settings: one line, status 1.
    close: called while the node still spins, so that it can tell others before it goes.
    """
    failures: list[BaseException] = []
    ended = threading.Event()
    for number in SIGNALS:
        signal.signal(number, lambda *_: ended.set())  # stays: a launcher often sends a second one
        atexit.register(signal.signal, number, signal.SIG_IGN)  # the interpreter's own end can take seconds

    def fail(error: BaseException) -> None:
        failures.append(error)
        ended.set()

    refusals: tuple[type[Exception], ...] = (BadArgumentsError, ParameterException, *errors)
    try:
        _init(args)
        node = make_node(fail)
    except refusals as error:
        fail(error)
    else:
        spinner = SpinThread(node, fail)
        while not ended.wait(_HEARD_S):  # a signal that comes just before a wait is heard after it
            pass
        if close:
            close(node)
        spinner.stop()
        node.destroy_node()
    rclpy.try_shutdown()
    for failure in failures:
        print(f"error: {' '.join(str(failure).split())}", file=sys.stderr)
    return 1 if failures else 0


class BadArgumentsError(CoreError):
    """ROS arguments on the command line that ROS does not understand."""


def _init(args: list[str] | None) -> None:
    try:
        # rclpy's own handlers would shut the context down before a node could say that it goes.
        rclpy.init(args=args, signal_handler_options=SignalHandlerOptions.NO)
    except RuntimeError as error:
        reason = str(error).split(", at /")[0]  # where in its own sources is of no use here
        raise BadArgumentsError(f"{reason}; look at what follows --ros-args") from None


class SpinThread:
    """Spins one node until it is told to stop.

    `Executor.shutdown` beside a running `spin` now and then takes away what that one just reaches for: here the thread
    ends first.
    """

    def __init__(
        self, node: Node, on_error: Fail, context: Context | None = None, executor: Executor | None = None
    ) -> None:
        """Begin to spin.

        on_error: told, in the new thread, of a callback's exception, which ends the spinning. executor: another than
        `node_executor`.
        """
        self._executor = executor or node_executor(context)  # what takes long has threads of its own
        self._executor.add_node(node)
        self._on_error = on_error
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, name="spin", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Let the callback in hand end, for `CLOSING_S` at most."""
        self._stopping.set()
        self._executor.wake()
        self._thread.join(timeout=CLOSING_S)
        self._executor.shutdown(timeout_sec=CLOSING_S)

    def _run(self) -> None:
        try:
            while not self._stopping.is_set():
                self._executor.spin_once(timeout_sec=CLOSING_S / 4)
        except ExternalShutdownException:
            pass
        except Exception as error:  # a defect: the process must not stay behind without its callbacks
            self._on_error(error)
            raise
