"""Requests of a person to the executor: approval of a plan, recovery, opening; and what it says of itself."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.client import Client
from rclpy.node import Node
from rclpy.task import Future
from std_srvs.srv import Trigger

from cliport_core import topics
from cliport_interfaces.srv import ApprovePlan
from demo_tool.ports import OnAnswer

_REPORT = "panda_executor: arm"  # the executor's report on /diagnostics; and its values that are read
_BUSY, _HELD_WIDTH = "busy", "held width [m]"
_EXECUTOR = "the executor"
_IDLE_REPORTS = 2  # in a row, before a recovery has ended: the first may be older than the recovery


class ExecutorRequests:
    """Clients of the executor's services for a person; every method is called in the node's thread."""

    def __init__(self, node: Node) -> None:
        self._approve: Client = node.create_client(ApprovePlan, topics.EXECUTOR_APPROVE)
        self._recover: Client = node.create_client(Trigger, topics.EXECUTOR_RECOVER)
        self._open: Client = node.create_client(Trigger, topics.EXECUTOR_OPEN)
        node.create_subscription(DiagnosticArray, topics.DIAGNOSTICS, self._on_report, 10)
        self.is_busy = False  # as the executor reported last
        self.held_width: float | None = None  # of what the hand holds [m], as it reported last
        self._on_end: Callable[[], None] | None = None  # of the recovery that goes on
        self._idle_reports = 0

    def approve(self, plan_id: str, on_answer: OnAnswer) -> None:
        """Approve the plan of that id; on_answer: told what the executor says to that."""
        call_service(self._approve, ApprovePlan.Request(plan_id=plan_id), on_answer, _EXECUTOR)

    def recover(self, on_answer: OnAnswer, on_end: Callable[[], None]) -> None:
        """Begin a recovery; on_answer: told whether it has begun; on_end: told once the executor is idle again."""

        def answered(ok: bool, words: str) -> None:
            if ok:
                self._on_end, self._idle_reports = on_end, 0
            on_answer(ok, words)

        call_service(self._recover, Trigger.Request(), answered, _EXECUTOR)

    def open_hand(self, on_answer: OnAnswer) -> None:
        """Begin to open the hand; on_answer: told whether that has begun."""
        call_service(self._open, Trigger.Request(), on_answer, _EXECUTOR)

    def _on_report(self, message: DiagnosticArray) -> None:
        for status in message.status:
            if status.name == _REPORT:
                self._take({value.key: value.value for value in status.values})

    def _take(self, values: dict[str, str]) -> None:
        self.is_busy = is_busy = values.get(_BUSY) == "true"
        width = values.get(_HELD_WIDTH, "none")
        self.held_width = None if width == "none" else float(width)
        self._idle_reports = 0 if is_busy else self._idle_reports + 1
        if self._on_end is not None and self._idle_reports >= _IDLE_REPORTS:
            on_end, self._on_end = self._on_end, None
            on_end()


def call_service(client: Client, request: Any, on_answer: OnAnswer, whose: str) -> None:
    """Call a service whose response has `success` and `message`, and hand those on; whose: its node, in words."""
    if not client.service_is_ready():
        on_answer(False, f"{whose} cannot be reached: is it running? (service {client.srv_name})")
        return

    def answered(done: Future) -> None:
        response = None if done.exception() is not None else done.result()
        if response is None:
            on_answer(False, f"{whose} gave no answer (service {client.srv_name})")
        else:
            on_answer(bool(response.success), str(response.message))

    client.call_async(request).add_done_callback(answered)
