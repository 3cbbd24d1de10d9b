"""A goal at an action server that is played, in a thread that runs when the test lets it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from panda_executor.action_goal import OwnedGoal


class Client:
    """Counts the goals that are sent."""

    def __init__(self) -> None:
        self.sent: list[Any] = []

    def send_goal_async(self, message: Any) -> Client:
        self.sent.append(message)
        return self

    def add_done_callback(self, callback: Callable[[Any], None]) -> None:
        """Nobody answers."""


def test_a_goal_that_is_given_up_before_it_was_sent_has_ended() -> None:
    """It used to be waited for, and every goal was cancelled because of it."""
    posted: list[Callable[[], None]] = []
    client = Client()
    goal = OwnedGoal(client, "the goal", posted.append)  # type: ignore[arg-type]
    goal.cancel()
    for function in posted:
        function()
    assert client.sent == []
    assert goal.ended.is_set() and goal.accepted is False
