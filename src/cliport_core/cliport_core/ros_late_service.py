"""A service whose answer may come after its callback has returned: the thread that spins the node does not wait for it.

rclpy's events executor takes no coroutines as a service's callback.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

from rclpy.node import Node

Give = Callable[[bool, str], None]  # success and message of the response


class LateService:
    """Offers a service whose response has `success` and `message`. The node is spun by one thread.

    Args:
        act: takes the request, and what to call with the answer: once, now or later, in the thread that spins.
    """

    def __init__(self, node: Node, kind: Any, name: str, act: Callable[[Any, Give], None]) -> None:
        self._act = act
        service: Any = node.create_service(kind, name, self._take)
        self._send = service.send_response
        service.send_response = self._send_or_keep
        self._call = _Call(None)

    def _take(self, request: Any, response: Any) -> Any:
        call = self._call = _Call(response)
        self._act(request, partial(self._give, call))
        return response

    def _give(self, call: _Call, success: bool, message: str) -> None:
        call.response.success, call.response.message = success, message
        call.answered = True
        if call.header is not None:
            self._send(call.response, call.header)

    def _send_or_keep(self, response: Any, header: Any) -> None:
        """Send the response that the executor has after the callback, or keep it until it is answered."""
        self._call.header = header
        if self._call.answered:
            self._send(response, header)


class _Call:
    """One call of the service: `header` says to whom the response goes; None while the callback runs."""

    def __init__(self, response: Any) -> None:
        self.response, self.header, self.answered = response, None, False
