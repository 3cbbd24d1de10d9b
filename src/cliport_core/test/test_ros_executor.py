"""The executor of the nodes, with a real node: it runs what is posted, and raises what callbacks raise."""

from __future__ import annotations

import gc
import threading
import time
import weakref
from collections.abc import Callable, Iterator
from typing import Any

import pytest
import rclpy
from action_msgs.msg import GoalStatus
from rclpy.action import ActionClient, GoalResponse
from rclpy.context import Context
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.task import Future
from ros_domain import next_domain

from cliport_core import ros_action_server
from cliport_core.ros_action_server import ThreadedActionServer
from cliport_core.ros_executor import node_executor
from cliport_core.ros_running import SpinThread
from cliport_core.ros_spin_queue import SpinQueue
from cliport_interfaces.action import PickPlace


@pytest.fixture
def node() -> Iterator[Node]:
    context = Context()
    rclpy.init(context=context, domain_id=next_domain())
    made = rclpy.create_node("spun", context=context)
    yield made
    made.destroy_node()
    context.try_shutdown()


def fail() -> None:
    raise ValueError("a defect")


async def fail_later() -> None:
    fail()


def in_a_timer(node: Node) -> None:
    node.create_timer(0.01, fail)


def in_a_task(node: Node) -> None:
    node.executor.create_task(fail)


def in_a_coroutine(node: Node) -> None:
    node.executor.create_task(fail_later)


def in_an_answers_callback(node: Node) -> None:
    answer = Future(executor=node.executor)
    answer.add_done_callback(lambda _: fail())
    answer.set_result(1)


def in_what_is_posted(node: Node) -> None:
    SpinQueue(node).post(fail)


@pytest.mark.parametrize("begin", [in_a_timer, in_a_task, in_a_coroutine, in_an_answers_callback, in_what_is_posted])
def test_a_defect_is_told_and_does_not_break_the_process(node: Node, begin: Callable[[Node], None]) -> None:
    told: list[BaseException] = []
    ended = threading.Event()

    def on_error(error: BaseException) -> None:
        told.append(error)
        ended.set()

    kept, threading.excepthook = threading.excepthook, lambda _: None  # the thread dies of it, as it should
    try:
        spinner = SpinThread(node, on_error, node.context)
        begin(node)
        assert ended.wait(60.0)
        spinner.stop()
    finally:
        threading.excepthook = kept
    assert [str(error) for error in told] == ["a defect"]


def test_what_another_thread_posts_runs_at_once_in_the_nodes_thread(node: Node) -> None:
    queue, ran = SpinQueue(node), threading.Event()
    names: list[str] = []

    def note() -> None:
        names.append(threading.current_thread().name)
        ran.set()

    spinner = SpinThread(node, lambda error: None, node.context)
    queue.post(note)
    assert ran.wait(60.0)
    spinner.stop()
    assert names == ["spin"]


def test_the_events_executor_is_used_where_rclpy_has_it(node: Node) -> None:
    experimental = pytest.importorskip("rclpy.experimental")
    assert type(experimental.EventsExecutor(context=node.context)) in type(node_executor(node.context)).__mro__


def test_a_defect_in_taking_a_goal_rejects_it_and_is_logged(node: Node, capfd: pytest.CaptureFixture[str]) -> None:
    def take(_: object) -> GoalResponse:
        raise ValueError("a defect")

    server = ThreadedActionServer(node, PickPlace, "/look", lambda _: PickPlace.Result(), goal_callback=take)
    client = ActionClient(node, PickPlace, "/look")
    told: list[BaseException] = []
    spinner = SpinThread(node, told.append, node.context)
    assert client.wait_for_server(60.0)
    answered = threading.Event()
    accepted: list[bool] = []

    def on_answer(answer: Future) -> None:
        accepted.append(answer.result().accepted)
        answered.set()

    SpinQueue(node).post(lambda: client.send_goal_async(PickPlace.Goal()).add_done_callback(on_answer))
    assert answered.wait(60.0)
    spinner.stop()
    server.destroy()
    client.destroy()
    assert accepted == [False] and told == []
    assert "REJECT of a goal for ValueError: a defect" in capfd.readouterr().err


@pytest.mark.parametrize("simulated", [False, True], ids=["wall time", "a simulation that stands still"])
def test_ended_goals_are_forgotten_by_and_by(node: Node, simulated: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ros_action_server, "RESULT_KEPT_S", 1)
    node.set_parameters([Parameter("use_sim_time", value=simulated)])

    def run(handle: Any) -> PickPlace.Result:
        handle.succeed()
        return PickPlace.Result()

    server = ThreadedActionServer(node, PickPlace, "/look", run)
    client = ActionClient(node, PickPlace, "/look")
    spinner = SpinThread(node, lambda error: None, node.context)
    assert client.wait_for_server(60.0)
    ended: list[Future] = []

    def begin() -> None:
        client.send_goal_async(PickPlace.Goal()).add_done_callback(
            lambda answer: answer.result().get_result_async().add_done_callback(ended.append)
        )

    for _ in range(3):
        SpinQueue(node).post(begin)
    known = []
    for _ in range(600):
        known.append(len(server._goal_handles))
        if len(ended) == 3 and not known[-1]:
            break
        time.sleep(0.1)
    spinner.stop()
    server.destroy()
    client.destroy()
    assert max(known) > 0 and known[-1] == 0, known
    assert [answer.result().status for answer in ended] == [GoalStatus.STATUS_SUCCEEDED] * 3


def test_the_clock_of_goals_outlives_their_server(node: Node) -> None:
    """rcl's timer for the results points into the clock until the server's own end."""
    server = ThreadedActionServer(node, PickPlace, "/look", lambda _: PickPlace.Result())
    clock = weakref.ref(server._node.get_clock())
    server.destroy()
    del server
    gc.collect()
    assert clock() is not None
