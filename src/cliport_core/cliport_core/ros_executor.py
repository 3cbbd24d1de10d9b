"""Executor of a node: rclpy's events executor where there is one, made to outlive the defects of callbacks."""

from __future__ import annotations

import faulthandler
import inspect
from typing import Any

from rclpy.context import Context
from rclpy.executors import Executor, SingleThreadedExecutor
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.utilities import get_default_context

_EventsExecutor: Any = getattr(rclpy_implementation, "EventsExecutor", None)  # None: rclpy before 7.1.4


def node_executor(context: Context | None = None) -> Executor:
    """Return an executor for one node.

    The events executor takes a third of the CPU: it does not look at every entity again for each message. It hands no
    message info to callbacks and knows no guard conditions (rclpy 7.1).
    """
    if _EventsExecutor is None:
        return SingleThreadedExecutor(context=context)
    faulthandler.enable()
    context = context or get_default_context()
    executor: Any = KeepingExecutor(context)
    context.on_shutdown(executor.wake)
    return executor  # type: ignore[no-any-return]


class KeepingExecutor(_EventsExecutor or object):  # type: ignore[misc]
    """Raises in `spin_once` what a task raised: in the C++ of rclpy 7.1 it would end in a segmentation fault.

    Tasks are what is posted to the executor, and the callbacks of futures, as of a service's answer.
    """

    _failure: Exception | None = None

    def create_task(self, callback: Any, *args: Any, **kwargs: Any) -> Any:
        """Run a function or a coroutine in the thread that spins; return its Task."""
        if inspect.iscoroutine(callback):
            return super().create_task(callback)
        return super().create_task(self._run, callback, *args, **kwargs)

    def spin_once(self, timeout_sec: float | None = None) -> None:
        """Run what is ready. Raises what a callback raised."""
        super().spin_once(timeout_sec)
        failure, self._failure = self._failure, None
        if failure is not None:
            raise failure

    async def _run(self, callback: Any, *args: Any, **kwargs: Any) -> Any:
        try:
            result = callback(*args, **kwargs)
            return await result if inspect.iscoroutine(result) else result
        except Exception as error:  # of whatever kind: `spin_once` raises it
            self._failure = self._failure or error
            return None
