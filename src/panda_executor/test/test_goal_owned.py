"""A goal at a server that is played: sent once, cancelled once it can be, over when the server says so."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import pytest

from panda_executor.action_goal import OwnedGoal


class Promise:
    """A future whose value the test tells."""

    def __init__(self) -> None:
        self.callbacks: list[Callable[[Any], None]] = []

    def add_done_callback(self, callback: Callable[[Any], None]) -> None:
        self.callbacks.append(callback)

    def tell(self, value: Any) -> None:
        for callback in self.callbacks:
            callback(SimpleNamespace(result=lambda: value))


class Server:
    """A client, the handle of its goal, and the thread of the node, which runs what is posted when it is told to."""

    def __init__(self, accepts: bool = True) -> None:
        self.response, self.result, self.log = Promise(), Promise(), list[str]()
        self.posted: list[Callable[[], None]] = []
        self.handle = SimpleNamespace(
            accepted=accepts, cancel_goal_async=lambda: self.log.append("cancel"), get_result_async=self._get
        )
        self.goal = OwnedGoal(self, "the goal", self.posted.append)  # type: ignore[arg-type]

    def send_goal_async(self, message: str) -> Promise:
        self.log.append(f"send {message}")
        return self.response

    def _get(self) -> Promise:
        self.log.append("ask for the result")
        return self.result

    def spin(self) -> None:
        while self.posted:
            self.posted.pop(0)()


def test_a_goal_goes_from_sending_to_its_end() -> None:
    server = Server()
    goal = server.goal
    assert server.log == [], "nothing of it happens in the caller's thread"
    server.spin()
    assert server.log == ["send the goal"]
    assert goal.accepted is None and goal.answer is None and not goal.ended.is_set()
    server.response.tell(server.handle)
    assert goal.accepted is True and not goal.ended.is_set()
    assert server.log[1:] == ["ask for the result"]
    server.result.tell("the answer")
    assert goal.ended.is_set() and goal.answer == "the answer"


@pytest.mark.parametrize("answers", [False, True])
def test_a_goal_that_is_not_taken_is_over(answers: bool) -> None:
    server = Server(accepts=False)
    server.spin()
    server.response.tell(server.handle if answers else None)
    assert server.goal.accepted is False and server.goal.ended.is_set()
    server.goal.cancel()
    server.spin()
    assert server.log == ["send the goal"], "there is nothing to cancel"


def test_a_cancel_of_a_goal_that_runs_is_sent_by_the_nodes_thread() -> None:
    server = Server()
    server.spin()
    server.response.tell(server.handle)
    server.goal.cancel()
    assert "cancel" not in server.log
    server.spin()
    assert server.log[-1] == "cancel"


def test_a_cancel_before_the_answer_follows_it() -> None:
    server = Server()
    server.spin()
    server.goal.cancel()
    server.spin()
    assert "cancel" not in server.log
    server.response.tell(server.handle)
    assert server.log == ["send the goal", "ask for the result", "cancel"]


def test_a_cancel_of_what_is_over_is_not_sent() -> None:
    server = Server()
    server.spin()
    server.response.tell(server.handle)
    server.result.tell("the answer")
    server.goal.cancel()
    server.spin()
    assert "cancel" not in server.log


def test_a_goal_that_was_given_up_before_it_was_sent_stays_here() -> None:
    server = Server()
    server.goal.cancel()
    server.spin()
    assert server.log == [] and server.goal.accepted is False and server.goal.ended.is_set()
