"""A service that answers now or later, on both executors, while the node's thread goes on."""

from __future__ import annotations

import time
from collections.abc import Callable

import pytest
import rclpy
from rclpy.context import Context
from rclpy.executors import Executor, SingleThreadedExecutor
from ros_domain import next_domain
from std_srvs.srv import Trigger

from cliport_core.ros_executor import node_executor
from cliport_core.ros_late_service import Give, LateService
from cliport_core.ros_running import SpinThread


def until(condition: Callable[[], bool]) -> bool:
    end = time.monotonic() + 20.0
    while time.monotonic() < end and not condition():
        time.sleep(0.01)
    return condition()


@pytest.mark.parametrize("executor", [node_executor, lambda context: SingleThreadedExecutor(context=context)])
def test_calls_are_answered_in_whatever_order(executor: Callable[[Context], Executor]) -> None:
    context = Context()
    rclpy.init(context=context, domain_id=next_domain())
    server, client_node = (rclpy.create_node(name, context=context) for name in ("server", "client"))
    asked: list[Give] = []
    failures: list[BaseException] = []

    def act(_: Trigger.Request, give: Give) -> None:
        asked.append(give)
        if len(asked) == 3:
            give(True, "at once")

    LateService(server, Trigger, "ask", act)
    client = client_node.create_client(Trigger, "ask")
    threads = [SpinThread(node, failures.append, context, executor(context)) for node in (server, client_node)]
    try:
        assert client.wait_for_service(20.0)
        futures = []
        for number in range(1, 4):
            futures.append(client.call_async(Trigger.Request()))
            assert until(lambda count=number: len(asked) == count), "an open call holds nobody up"
        assert until(futures[2].done) and futures[2].result().message == "at once"
        assert not futures[0].done() and not futures[1].done()
        for number, words in ((1, "second"), (0, "first")):
            server.executor.create_task(asked[number], False, words)
            assert until(futures[number].done)
            assert (futures[number].result().success, futures[number].result().message) == (False, words)
        assert not failures
    finally:
        for thread in threads:
            thread.stop()
        rclpy.shutdown(context=context)
