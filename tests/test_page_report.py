"""The page reads in the executor's report on /diagnostics whether that does something, and what the hand holds."""

from types import SimpleNamespace

import pytest

from demo_tool.ros_requests import ExecutorRequests
from panda_executor.conversions import diagnostics_to_msg
from panda_executor.health import AgeLimits, assess

LIMITS = AgeLimits(1.0, 1.0, 0.1)


@pytest.mark.parametrize("held_width", [None, 0.04])
@pytest.mark.parametrize("busy", [True, False])
def test_the_page_reads_what_the_executor_does_and_holds(busy: bool, held_width: float | None) -> None:
    node = SimpleNamespace(
        create_client=lambda *_: None,
        create_subscription=lambda kind, name, on_message, depth: setattr(node, "on_message", on_message),
    )
    requests = ExecutorRequests(node)
    requests.is_busy, requests.held_width = not busy, 0.08
    report = assess(0.1, 0.1, True, True, "another goal is being executed", busy, LIMITS, held_width)
    node.on_message(diagnostics_to_msg(report, 0))
    assert (requests.is_busy, requests.held_width) == (busy, held_width)
