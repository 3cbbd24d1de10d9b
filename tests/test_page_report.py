"""The page reads in the executor's report on /diagnostics whether that does something."""

from types import SimpleNamespace

import pytest

from demo_tool.ros_requests import ExecutorRequests
from panda_executor.conversions import diagnostics_to_msg
from panda_executor.health import AgeLimits, assess


@pytest.mark.parametrize("busy", [True, False])
def test_the_page_reads_whether_the_executor_is_busy(busy: bool) -> None:
    node = SimpleNamespace(
        create_client=lambda *_: None,
        create_subscription=lambda kind, name, on_message, depth: setattr(node, "on_message", on_message),
    )
    requests = ExecutorRequests(node)
    requests.is_busy = not busy
    report = assess(0.1, 0.1, True, True, "another goal is being executed", busy, AgeLimits(1.0, 1.0, 0.1))
    node.on_message(diagnostics_to_msg(report, 0))
    assert requests.is_busy is busy
