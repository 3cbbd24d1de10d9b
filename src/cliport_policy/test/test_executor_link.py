"""The link to the executor without a graph: what is sent and asked, and what comes back to the server."""

from __future__ import annotations

from typing import Any

import pytest

pytest.importorskip("cliport_interfaces.msg")

from action_msgs.msg import GoalStatus
from std_srvs.srv import Trigger

from cliport_core.action import ActionGoal, PickPlaceAction
from cliport_core.outcome import Outcome
from cliport_core.pose import PlanarPose
from cliport_interfaces.action import PickPlace
from cliport_policy.server import executor_link
from cliport_policy.server.executor_link import ExecutorLink
from cliport_policy.server.types import Answer, Moment

POSE = PlanarPose(0.4, 0.1, 0.3)
GOAL = ActionGoal(PickPlaceAction(POSE, POSE), "put it there", 7)
NOW = Moment(3.0, 4)


class Future:
    """Done when told."""

    def __init__(self) -> None:
        self.callbacks: list[Any] = []

    def add_done_callback(self, callback: Any) -> None:
        self.callbacks.append(callback)

    def end(self, value: Any) -> None:
        self.value = value
        for callback in self.callbacks:
            callback(self)

    def result(self) -> Any:
        return self.value

    def exception(self) -> None:
        return None


class Client:
    """An action's or a service's client that notes what it was asked."""

    def __init__(self, *names: Any) -> None:
        self.names, self.ready, self.asked, self.future = names, True, [], Future()
        self.srv_name = names[-1]

    def server_is_ready(self) -> bool:
        return self.ready

    service_is_ready = server_is_ready

    def call_async(self, request: Any) -> Future:
        self.asked.append(request)
        self.future = Future()
        return self.future

    def send_goal_async(self, goal: Any, feedback_callback: Any) -> Future:
        self.asked.append(goal)
        self.feedback = feedback_callback
        return self.future


class Node:
    """Hands out clients, and is its own publisher and logger."""

    def __init__(self) -> None:
        self.clients: dict[str, Client] = {}
        self.sent: list[str] = []
        self.warnings: list[str] = []
        self.heartbeat: Any = None

    def get_name(self) -> str:
        return "cliport_policy"

    def create_publisher(self, kind: Any, topic: str, depth: int) -> Node:
        assert (topic, depth) == ("/cliport/owner_heartbeat", 10) or topic.endswith("heartbeat")
        return self

    def publish(self, message: Any) -> None:
        self.sent.append(message.data)

    def create_client(self, kind: Any, name: str) -> Client:
        return self.clients.setdefault(name, Client(name))

    def create_subscription(self, kind: Any, topic: str, callback: Any, depth: int) -> None:
        self.heartbeat = callback

    def get_logger(self) -> Node:
        return self

    def warning(self, words: str) -> None:
        self.warnings.append(words)


class Handle:
    """An answer to a goal."""

    def __init__(self, accepted: bool) -> None:
        self.accepted, self.future, self.cancelled = accepted, Future(), 0

    def get_result_async(self) -> Future:
        return self.future

    def cancel_goal_async(self) -> None:
        self.cancelled += 1


class Server:
    """Notes what it hears."""

    def __init__(self) -> None:
        self.heard: list[tuple[Any, ...]] = []

    def __getattr__(self, name: str) -> Any:
        return lambda *arguments: self.heard.append((name, *arguments))


@pytest.fixture
def action(monkeypatch: pytest.MonkeyPatch) -> Client:
    client = Client("action")
    monkeypatch.setattr(executor_link, "ActionClient", lambda *_: client)
    return client


def make(action: Client) -> tuple[ExecutorLink, Node, Server]:
    node, server = Node(), Server()
    link = ExecutorLink(node, "base", lambda: NOW)  # type: ignore[arg-type]
    link.attach(server)  # type: ignore[arg-type]
    return link, node, server


def test_a_goal_from_its_sending_to_its_result(action: Client) -> None:
    link, node, server = make(action)
    link.send(5, GOAL)
    link.beat()
    (sent,) = action.asked
    assert (sent.instruction, sent.header.frame_id, sent.owner) == ("put it there", "base", node.sent[0])
    name, _, digits = sent.owner.rpartition("-")
    assert name == "cliport_policy" and len(digits) == 8 and int(digits, 16) >= 0
    handle = Handle(True)
    link.cancel(5)  # there is nothing to be cancelled yet
    action.future.end(handle)
    feedback = type("Message", (), {"feedback": PickPlace.Feedback(phase_name="CARRY")})
    action.feedback(feedback)
    waiting = PickPlace.Feedback(phase=PickPlace.Feedback.PHASE_APPROVAL, phase_name="APPROVAL", plan_id="1a2b3c4d")
    for message in (waiting, PickPlace.Feedback(phase_name="DESCEND", plan_id="1a2b3c4d")):
        action.feedback(type("Message", (), {"feedback": message}))
    link.cancel(4)
    assert handle.cancelled == 0
    link.cancel(5)
    assert handle.cancelled == 1
    result = PickPlace.Result(outcome=PickPlace.Result.OUTCOME_SUCCEEDED, message="done")
    handle.future.end(type("Response", (), {"status": GoalStatus.STATUS_SUCCEEDED, "result": result}))
    link.cancel(5)
    assert handle.cancelled == 1  # it is over
    assert server.heard[:4] == [
        ("on_goal_response", 5, True, NOW),
        ("on_feedback", 5, "CARRY", NOW, ""),
        ("on_feedback", 5, "APPROVAL", NOW, "1a2b3c4d"),
        ("on_feedback", 5, "DESCEND", NOW, ""),
    ]
    kind, token, answer, now = server.heard[4]
    assert (kind, token, answer.outcome, answer.message, now) == ("on_result", 5, Outcome.SUCCEEDED, "done", NOW)


def test_a_result_that_says_success_of_a_goal_that_was_aborted_is_none(action: Client) -> None:
    link, _, server = make(action)
    link.send(1, GOAL)
    handle = Handle(True)
    action.future.end(handle)
    result = PickPlace.Result(outcome=PickPlace.Result.OUTCOME_SUCCEEDED)
    handle.future.end(type("Response", (), {"status": GoalStatus.STATUS_ABORTED, "result": result}))
    assert server.heard[-1][2].outcome is not Outcome.SUCCEEDED


def test_a_refusal_is_told_and_leaves_nothing_to_cancel(action: Client) -> None:
    link, _, server = make(action)
    link.send(2, GOAL)
    handle = Handle(False)
    action.future.end(handle)
    link.cancel(2)
    assert server.heard == [("on_goal_response", 2, False, NOW)] and not handle.future.callbacks
    assert handle.cancelled == 0


def test_answers_that_never_came_and_servers_that_are_not_there(action: Client) -> None:
    node = Node()
    link = ExecutorLink(node, "base", lambda: NOW)  # type: ignore[arg-type]
    link.send(1, GOAL)
    action.future.end(Handle(True))  # nobody listens yet
    node.heartbeat(None)
    action.feedback(None)
    server = Server()
    link.attach(server)  # type: ignore[arg-type]
    action.future.end(None)
    link._on_result(1, None)
    assert server.heard == []
    node.heartbeat(None)
    assert server.heard == [("on_heartbeat", NOW)]
    assert link.is_ready() is True
    action.ready = False
    assert link.is_ready() is False


@pytest.mark.parametrize("name", ["stop", "resume"])
def test_a_service_is_called_where_it_is_there(action: Client, name: str) -> None:
    link, node, _ = make(action)
    client = next(client for topic, client in node.clients.items() if topic.endswith(f"/{name}"))
    assert getattr(link, name)() and len(client.asked) == 1 and not node.warnings
    client.ready = False
    assert not getattr(link, name)() and len(client.asked) == 1
    assert node.warnings == [f"service {client.srv_name} is not there: is the executor running?"]
    assert all(not other.asked for other in node.clients.values() if other is not client)


def test_who_asks_is_told_what_the_executor_answers_or_that_it_does_not(action: Client) -> None:
    """A process that hangs is still discovered: what was sent to it is not what it does."""
    node, wall = Node(), [3.0]
    link = ExecutorLink(node, "base", lambda: Moment(wall[0], 4))  # type: ignore[arg-type]
    told: list[Answer | None] = []
    assert not link.when_answered(told.append), "it was asked nothing"
    client = node.clients["/panda_executor/stop"]
    for success, words in ((True, "stopped"), (False, "not now")):
        assert link.stop() and link.when_answered(told.append)
        wall[0] += 1.0
        link.beat()
        client.future.end(Trigger.Response(success=success, message=words))
        assert told.pop() == (success, words)
    assert link.stop() and link.when_answered(told.append)
    wall[0] += 1.01
    link.beat()
    assert told == [None]
    client.future.end(Trigger.Response(success=True))
    assert told == [None], "it comes too late"
    assert link.approve("1a2b")
    node.clients["/panda_executor/approve"].future.end(None)
    assert link.when_answered(told.append) and told == [None, None], "answered before somebody asked"
    assert not link.when_answered(told.append), "each answer is told once"
    client.ready = False
    assert link.approve("1a2b") and not link.stop() and not link.when_answered(told.append)
