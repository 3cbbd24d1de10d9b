"""The ROS side of the pick-and-place executor: one goal at a time, stop, resume, heartbeat."""

from __future__ import annotations

import uuid
from collections.abc import Callable
from dataclasses import replace
from typing import Any

from action_msgs.msg import GoalStatus
from rclpy.action import ActionClient
from rclpy.action.client import ClientGoalHandle
from rclpy.node import Node
from rclpy.task import Future
from std_msgs.msg import Empty, String
from std_srvs.srv import Trigger

from cliport_core import topics
from cliport_core.action import ActionGoal
from cliport_core.messages import goal_to_msg, result_from_msg
from cliport_interfaces.action import PickPlace
from cliport_interfaces.srv import ApprovePlan
from cliport_policy.server.logic import PolicyServer
from cliport_policy.server.types import Answer, Moment

_ANSWER_TIME = 1.0  # for the executor's answer to a service call, wall clock [s]


class _Question:
    """A service call to the executor, over once it is answered, or given up at `deadline` (wall clock [s])."""

    def __init__(self, deadline: float) -> None:
        self.deadline, self.over = deadline, False
        self._answer: Answer | None = None
        self._then: Callable[[Answer | None], None] | None = None

    def wait(self, then: Callable[[Answer | None], None]) -> None:
        """Call `then` with the answer once it is over."""
        self._then = then
        if self.over:
            then(self._answer)

    def on_done(self, future: Future) -> None:
        """Take the service's response."""
        response = None if future.exception() is not None else future.result()
        self.end(None if response is None else Answer(bool(response.success), str(response.message)))

    def end(self, answer: Answer | None) -> None:
        """Take the answer, None where there is none."""
        if self.over:
            return
        self.over, self._answer = True, answer
        if self._then is not None:
            self._then(answer)


class ExecutorLink:
    """Sends what the policy server asks for; the executor's answers go back with the goal's token."""

    def __init__(self, node: Node, base_frame: str, now: Callable[[], Moment]) -> None:
        self._node = node
        self._base_frame = base_frame
        self._now = now
        self._server: PolicyServer | None = None
        self._handles: dict[int, ClientGoalHandle] = {}
        self._owner = f"{node.get_name()}-{uuid.uuid4().hex[:8]}"
        self._beats = node.create_publisher(String, topics.OWNER_HEARTBEAT, 10)
        self._action = ActionClient(node, PickPlace, topics.PICK_PLACE)
        self._stop = node.create_client(Trigger, topics.EXECUTOR_STOP)
        self._resume = node.create_client(Trigger, topics.EXECUTOR_RESUME)
        self._approve = node.create_client(ApprovePlan, topics.EXECUTOR_APPROVE)
        self._asked: _Question | None = None  # what was asked last, until somebody wants its answer
        self._questions: list[_Question] = []
        node.create_subscription(Empty, topics.HEARTBEAT, self._on_heartbeat, 10)

    def attach(self, server: PolicyServer) -> None:
        """Send answers to this server from now on."""
        self._server = server

    def beat(self) -> None:
        """Give a sign of life, without which the executor stops what this server asked for; call often (20 Hz).

        Who waits for an answer of the executor for too long is told here.
        """
        self._beats.publish(String(data=self._owner))
        now = self._now().wall
        for question in self._questions:
            if now > question.deadline:
                question.end(None)
        self._questions = [question for question in self._questions if not question.over]

    def is_ready(self) -> bool:
        """Return True if the action server is there."""
        return bool(self._action.server_is_ready())

    def send(self, token: int, goal: ActionGoal) -> None:
        """Start one goal."""
        message = goal_to_msg(replace(goal, owner=self._owner), self._base_frame)
        future = self._action.send_goal_async(message, feedback_callback=lambda m: self._on_feedback(token, m))
        future.add_done_callback(lambda done: self._on_response(token, done.result()))

    def cancel(self, token: int) -> None:
        """Ask for the goal's end; nothing happens when it was not accepted yet or is over."""
        handle = self._handles.get(token)
        if handle is not None:
            handle.cancel_goal_async()

    def stop(self) -> bool:
        """Call the executor's own, latching stop; return whether that service is there."""
        return self._call(self._stop, Trigger.Request())

    def resume(self) -> bool:
        """End the executor's stop; return whether that service is there."""
        return self._call(self._resume, Trigger.Request())

    def approve(self, plan_id: str) -> bool:
        """Ask the executor to run its plan of that id; return whether that service is there."""
        return self._call(self._approve, ApprovePlan.Request(plan_id=plan_id))

    def when_answered(self, then: Callable[[Answer | None], None]) -> bool:
        """Call `then` once with the executor's answer to what it was asked last: None where it gives none in 1 s.

        Return False, and do not call it, where the executor was asked nothing since the last time.
        """
        asked, self._asked = self._asked, None
        if asked is None:
            return False
        asked.wait(then)
        return True

    def _call(self, client: Any, request: Any) -> bool:
        self._asked = None
        if client.service_is_ready():
            self._asked = _Question(self._now().wall + _ANSWER_TIME)
            self._questions.append(self._asked)
            client.call_async(request).add_done_callback(self._asked.on_done)
            return True
        self._node.get_logger().warning(f"service {client.srv_name} is not there: is the executor running?")
        return False

    def _on_heartbeat(self, _: Empty) -> None:
        if self._server:
            self._server.on_heartbeat(self._now())

    def _on_response(self, token: int, handle: ClientGoalHandle | None) -> None:
        if self._server is None or handle is None:
            return
        if handle.accepted:
            self._handles[token] = handle
            handle.get_result_async().add_done_callback(lambda done: self._on_result(token, done.result()))
        self._server.on_goal_response(token, bool(handle.accepted), self._now())

    def _on_feedback(self, token: int, message: Any) -> None:
        if self._server:
            feedback = message.feedback
            waits = feedback.phase == PickPlace.Feedback.PHASE_APPROVAL
            plan_id = str(feedback.plan_id) if waits else ""
            self._server.on_feedback(token, str(feedback.phase_name), self._now(), plan_id)

    def _on_result(self, token: int, response: Any) -> None:
        self._handles.pop(token, None)
        if self._server is None or response is None:
            return
        ended_well = response.status == GoalStatus.STATUS_SUCCEEDED
        self._server.on_result(token, result_from_msg(response.result, ended_well), self._now())
