"""The executor's services for a person over real middleware, from the arm of the page."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from types import SimpleNamespace
from typing import Any

import pytest
import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.task import Future
from ros_domain import next_domain
from std_srvs.srv import Trigger

from cliport_core import topics
from cliport_core.ros_running import SpinThread
from cliport_core.ros_spin_queue import SpinQueue
from cliport_interfaces.srv import ApprovePlan, LoadPolicy
from demo_tool.ros_arm import RosArm
from demo_tool.ros_policy import RosPolicy
from demo_tool.ros_requests import ExecutorRequests


class World:
    """An executor's services in one node, and the page's arm in another."""

    def __init__(self) -> None:
        self.executor, self.page = rclpy.create_node("panda_executor"), rclpy.create_node("demo_tool")
        queue = SpinQueue(self.page)
        self.arm = RosArm(self.page, "panda_link0", queue.post)
        self.refusal = ""
        self.heard: list[tuple[bool, str]] = []
        self.ended = 0
        self.executor.create_service(ApprovePlan, topics.EXECUTOR_APPROVE, self._on_approve)
        self.executor.create_service(Trigger, topics.EXECUTOR_RECOVER, self._on_recover)
        self.executor.create_service(Trigger, topics.EXECUTOR_OPEN, self._on_recover)
        self.reports = self.executor.create_publisher(DiagnosticArray, topics.DIAGNOSTICS, 10)

    def _on_approve(self, request: ApprovePlan.Request, response: ApprovePlan.Response) -> ApprovePlan.Response:
        response.success, response.message = request.plan_id == "1a2b3c4d", f"asked for {request.plan_id}"
        return response

    def _on_recover(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        response.success, response.message = not self.refusal, self.refusal or "begun"
        return response

    def hear(self, ok: bool, words: str) -> None:
        self.heard.append((ok, words))

    def end(self) -> None:
        self.ended += 1

    def report(self, busy: bool, held: str = "none") -> None:
        other = DiagnosticStatus(name="camera", values=[KeyValue(key="busy", value="false")])
        values = [KeyValue(key="busy", value=str(busy).lower()), KeyValue(key="held width [m]", value=held)]
        mine = DiagnosticStatus(name="panda_executor: arm", values=values)
        self.reports.publish(DiagnosticArray(status=[other, mine]))

    def until(self, condition: Callable[[], object]) -> None:
        end = time.monotonic() + 8.0
        while not condition():
            assert time.monotonic() < end, (self.heard, self.ended)
            time.sleep(0.02)


@pytest.fixture
def world() -> Iterator[World]:
    rclpy.init(domain_id=next_domain())
    made = World()
    faults: list[BaseException] = []
    spinners = [SpinThread(node, faults.append) for node in (made.executor, made.page)]
    yield made
    made.arm.close()
    for spinner in spinners:
        spinner.stop()
    rclpy.try_shutdown()
    assert not faults


def reached(world: World, ask: Callable[[], None]) -> tuple[bool, str]:
    """Ask until the executor has been found; return its answer."""

    def answered() -> bool:
        world.heard.clear()
        ask()
        world.until(lambda: world.heard)
        return "cannot be reached" not in world.heard[0][1]

    world.until(answered)
    return world.heard[0]


def test_the_executor_answers_an_approval_by_the_plans_id(world: World) -> None:
    assert reached(world, lambda: world.arm.approve("1a2b3c4d", world.hear)) == (True, "asked for 1a2b3c4d")
    assert reached(world, lambda: world.arm.approve("99999999", world.hear)) == (False, "asked for 99999999")


def test_a_recovery_ends_once_the_executor_is_idle_again(world: World) -> None:
    world.refusal = "another goal is being executed"
    assert reached(world, lambda: world.arm.recover(world.hear, world.end)) == (False, world.refusal)
    world.refusal = ""
    assert reached(world, lambda: world.arm.recover(world.hear, world.end)) == (True, "begun")
    world.until(lambda: world.reports.get_subscription_count() > 0)
    world.report(busy=False)  # from before it began
    world.report(busy=True)
    world.until(world.arm.is_busy)
    assert world.ended == 0
    world.report(busy=False)
    world.until(lambda: not world.arm.is_busy())
    assert world.ended == 0  # the report may be older than the recovery
    world.report(busy=False)
    world.until(lambda: world.ended)
    world.report(busy=False)
    assert not world.arm.is_busy() and world.ended == 1


def test_the_hand_is_opened_once_the_executor_takes_it(world: World) -> None:
    world.refusal = "another goal is being executed"
    assert reached(world, lambda: world.arm.open_hand(world.hear)) == (False, world.refusal)
    world.refusal = ""
    assert reached(world, lambda: world.arm.open_hand(world.hear)) == (True, "begun")
    world.until(lambda: world.reports.get_subscription_count() > 0)
    world.report(busy=False, held="0.040")
    world.until(lambda: world.arm.held_width() == 0.04)
    world.report(busy=False)
    world.until(lambda: world.arm.held_width() is None)


def test_an_executor_that_is_not_there_is_said(world: World) -> None:
    remap = ["--ros-args", "-r", "/panda_executor/approve:=/none", "-r", "/panda_executor/recover:=/nothing"]
    remap += ["-r", "/panda_executor/open:=/nowhere"]
    requests = ExecutorRequests(rclpy.create_node("alone", cli_args=remap))
    requests.approve("1a2b3c4d", world.hear)
    requests.recover(world.hear, world.end)
    requests.open_hand(world.hear)
    words = [words for ok, words in world.heard if not ok]
    assert len(words) == 3 and all("cannot be reached: is it running? (service /" in line for line in words)


@pytest.mark.parametrize("ready", [True, False])
def test_another_policy_is_asked_for(ready: bool) -> None:
    answer, asked, heard = Future(), list[Any](), list[tuple[bool, str]]()
    client = SimpleNamespace(
        service_is_ready=lambda: ready, call_async=lambda request: asked.append(request) or answer, srv_name="/load"
    )
    node: Any = SimpleNamespace(create_client=lambda kind, name: client, create_publisher=lambda *_: None)
    RosPolicy(node, "base", lambda act: act()).load("runs/mine", lambda ok, words: heard.append((ok, words)))
    answer.set_result(LoadPolicy.Response(success=True, message="loading the policy runs/mine"))
    if ready:
        assert asked == [LoadPolicy.Request(checkpoint="runs/mine")]
        assert heard == [(True, "loading the policy runs/mine")]
    else:
        assert heard == [(False, "the policy server cannot be reached: is it running? (service /load)")]
