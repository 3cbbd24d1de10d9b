"""Arm of the station: the executor's action, stop services and heartbeat."""

from __future__ import annotations

import time
import uuid
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

from action_msgs.msg import GoalStatus
from rclpy.action import ActionClient
from rclpy.action.client import ClientGoalHandle
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.node import Node
from rclpy.task import Future
from std_msgs.msg import Empty, String
from std_srvs.srv import Trigger

from cliport_core import topics
from cliport_core.action import ActionGoal
from cliport_core.heartbeat import Heartbeat
from cliport_core.messages import goal_to_msg, result_from_msg
from cliport_core.outcome import ActionResult, Outcome
from cliport_interfaces.action import PickPlace
from demo_tool.ports import ACCEPTED, OnAnswer, OnEnd, OnFailure, OnPhase
from demo_tool.ros_requests import ExecutorRequests

_HEARTBEAT_TIMEOUT = 1.0  # [s]
_BEAT_PERIOD = 0.05  # of its own signs of life [s]
_LONGEST_TURN = 3.0  # of the node's thread, before it counts as hung [s]
_STOP_TIMEOUT = 1.0  # for the executor's answer to a stop [s]
_STOP_FAILED = "STOP did not reach the executor: use the arm's own emergency stop"
_STOPS = (topics.EXECUTOR_STOP, topics.STOP)
_RESUMES = (topics.EXECUTOR_RESUME, topics.RESUME)


class RosArm:
    """An `Arm` whose methods may be called from any thread; `post` calls their work in the node's thread."""

    def __init__(self, node: Node, base_frame: str, post: Callable[[Callable[[], None]], None]) -> None:
        self._node, self._base_frame, self._post = node, base_frame, post
        self._action = ActionClient(node, PickPlace, topics.PICK_PLACE)
        self._owner = f"{node.get_name()}-{uuid.uuid4().hex[:8]}"
        beats = node.create_publisher(String, topics.OWNER_HEARTBEAT, 10)
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._turned = time.monotonic()
        node.create_timer(_BEAT_PERIOD, self._turn, clock=steady)
        # From a thread of its own: the node's may be at a picture or at the disk for longer than a motion waits.
        self._heart = Heartbeat(lambda: beats.publish(String(data=self._owner)), _BEAT_PERIOD, self._turns)
        self._triggers = {name: node.create_client(Trigger, name) for name in (*_STOPS, *_RESUMES)}
        self._requests = ExecutorRequests(node)
        node.create_subscription(Empty, topics.HEARTBEAT, self._on_heartbeat, 1)
        self._beat: float | None = None
        self._fault: str | None = "the executor has not been looked for yet"
        self._goal: _Goal | None = None
        self._check: _Goal | None = None
        self._sent_stops: list[_SentStop] = []

    def fault(self) -> str | None:
        """Return one line that says why the executor can take no goal now, or None."""
        return self._fault

    def close(self) -> None:
        """End the signs of life; to be called before the node ends."""
        self._heart.stop()

    def look(self) -> None:
        """Update `fault`, and report stops without effect; to be called a few times a second in the node's thread."""
        self._check_stops()
        if not self._action.server_is_ready():
            self._fault = f"the executor is not there: is it running? (action {topics.PICK_PLACE})"
        elif not self._triggers[topics.EXECUTOR_STOP].service_is_ready():
            self._fault = f"the executor's stop cannot be reached: is it running? (service {topics.EXECUTOR_STOP})"
        elif self._beat is not None and time.monotonic() - self._beat > _HEARTBEAT_TIMEOUT:
            self._fault = f"the executor gives no sign of life for {time.monotonic() - self._beat:.0f} s"
        else:
            self._fault = None

    def send(self, goal: ActionGoal, on_phase: OnPhase, on_end: OnEnd) -> None:
        """Send a goal to the executor."""
        self._post(lambda: self._send(_Goal(on_phase, on_end), goal))

    def cancel(self) -> None:
        """Cancel the present goal, now or once it is accepted."""
        self._post(self._cancel)

    def check(self, goal: ActionGoal, on_end: OnEnd) -> None:
        """Have the executor plan a goal, beside `send`."""
        self._post(lambda: self._send_check(_Goal(lambda *_: None, on_end), goal))

    def cancel_check(self) -> None:
        """Cancel the check, now or once it is accepted."""
        self._post(lambda: self._check.cancel() if self._check is not None else None)

    def approve(self, plan_id: str, on_answer: OnAnswer) -> None:
        """Approve the plan of that id, and no other; on_answer: told in the node's thread what the executor says."""
        self._post(lambda: self._requests.approve(plan_id, on_answer))

    def recover(self, on_answer: OnAnswer, on_end: Callable[[], None]) -> None:
        """Begin to move the arm back to its ready pose; both are told in the node's thread, as `Arm` has it."""
        self._post(lambda: self._requests.recover(on_answer, on_end))

    def open_hand(self, on_answer: OnAnswer) -> None:
        """Begin to open the hand; on_answer: told in the node's thread whether that has begun."""
        self._post(lambda: self._requests.open_hand(on_answer))

    def held_width(self) -> float | None:
        """Return how wide is what the hand holds [m], as the executor said last; None where that is nothing."""
        return self._requests.held_width

    def is_busy(self) -> bool:
        """Return True if the executor said last that it does something, for whomever."""
        return self._requests.is_busy

    def stop(self, reason: str, on_failure: OnFailure) -> None:
        """Cancel the goal, and stop the executor and the policy server until `resume`.

        on_failure: told in the node's thread where the executor does not confirm its stop.
        """
        self._post(lambda: self._stop(reason, on_failure))

    def resume(self) -> None:
        """End the stops of the executor and of the policy server."""
        self._post(self._resume)

    def _send(self, mine: _Goal, goal: ActionGoal) -> None:
        self._goal = mine
        self._hand_on(mine, goal)

    def _send_check(self, mine: _Goal, goal: ActionGoal) -> None:
        self._check = mine
        self._hand_on(mine, goal)

    def _hand_on(self, mine: _Goal, goal: ActionGoal) -> None:
        sent = self._action.send_goal_async(
            goal_to_msg(replace(goal, owner=self._owner), self._base_frame),
            feedback_callback=lambda message: mine.on_feedback(message.feedback),
        )
        sent.add_done_callback(lambda done: mine.on_answer(done.result()))

    def _cancel(self) -> None:
        if self._goal is not None:
            self._goal.cancel()

    def _stop(self, reason: str, on_failure: OnFailure) -> None:
        answer = self._call(topics.EXECUTOR_STOP)
        self._call(topics.STOP)
        self._cancel()
        self._node.get_logger().warning(f"stop: {reason}")
        self._sent_stops.append(_SentStop(answer, time.monotonic() + _STOP_TIMEOUT, on_failure))
        self._check_stops()

    def _resume(self) -> None:
        for name in _RESUMES:
            self._call(name)

    def _call(self, name: str) -> Future | None:
        """Call a service; return its answer to come, or None where there is no such service."""
        if self._triggers[name].service_is_ready():
            return self._triggers[name].call_async(Trigger.Request())
        self._node.get_logger().warning(f"service {name} is not there, and was not called")
        return None

    def _check_stops(self) -> None:
        now, sent = time.monotonic(), self._sent_stops
        self._sent_stops = [stop for stop in sent if stop.is_open(now)]
        for stop in sent:
            if stop not in self._sent_stops and not stop.is_confirmed():
                self._node.get_logger().error(_STOP_FAILED)
                stop.on_failure(_STOP_FAILED)

    def _turn(self) -> None:
        self._turned = time.monotonic()

    def _turns(self) -> bool:
        return time.monotonic() - self._turned < _LONGEST_TURN

    def _on_heartbeat(self, _: Empty) -> None:
        self._beat = time.monotonic()


@dataclass(frozen=True, eq=False)
class _SentStop:
    """A stop that the executor is to confirm; answer: None where it could not be sent; deadline: steady time [s]."""

    answer: Future | None
    deadline: float
    on_failure: OnFailure

    def is_open(self, now: float) -> bool:
        return self.answer is not None and not self.answer.done() and now < self.deadline

    def is_confirmed(self) -> bool:
        if self.answer is None or not self.answer.done() or self.answer.exception() is not None:
            return False
        response = self.answer.result()
        return response is not None and bool(response.success)


class _Goal:
    """Callbacks of one goal that was sent."""

    def __init__(self, on_phase: OnPhase, on_end: OnEnd) -> None:
        self._on_phase, self._on_end = on_phase, on_end
        self._handle: ClientGoalHandle | None = None
        self._cancelled = False

    def on_feedback(self, feedback: PickPlace.Feedback) -> None:
        self._on_phase(str(feedback.phase_name), float(feedback.progress), str(feedback.plan_id))

    def on_answer(self, handle: ClientGoalHandle | None) -> None:
        if handle is None or not handle.accepted:
            line = "the executor did not take the goal: it is busy, or stopped (resume ends a stop)"
            self._on_end(ActionResult(Outcome.REJECTED, line))
            return
        self._handle = handle
        self._on_phase(ACCEPTED, 0.0)
        handle.get_result_async().add_done_callback(lambda done: self._on_result(done.result()))
        if self._cancelled:
            handle.cancel_goal_async()

    def cancel(self) -> None:
        self._cancelled = True
        if self._handle is not None:
            self._handle.cancel_goal_async()

    def _on_result(self, response: Any) -> None:
        self._handle = None
        if response is None:
            self._on_end(ActionResult(Outcome.EXECUTION_FAILED, "the executor gave no result"))
            return
        ended_well = response.status == GoalStatus.STATUS_SUCCEEDED
        self._on_end(result_from_msg(response.result, ended_well))
