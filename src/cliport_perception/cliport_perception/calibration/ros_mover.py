"""The executor as what moves the hand during a calibration."""

from __future__ import annotations

import time
import uuid
from collections.abc import Callable
from typing import Any

from action_msgs.msg import GoalStatus
from rclpy.action import ActionClient
from rclpy.node import Node
from std_msgs.msg import Empty, String

from cliport_core import topics
from cliport_core.action import HandGoal
from cliport_core.heartbeat import Heartbeat
from cliport_core.messages_hand import hand_goal_to_msg, hand_result_from_msg
from cliport_core.outcome import ActionResult, Outcome
from cliport_core.pose import Pose
from cliport_interfaces.action import MoveHand, PickPlace

_LONGEST_TURN = 3.0  # of the thread that spins, before it counts as hung [s]
_SILENT = 5.0  # without a sign of life of the executor, before its motion is given up [s]


class HandMover:
    """Sends goals of the hand; to be called in the thread that spins the node.

    Args:
        carried: how far the board reaches from the tcp [m].
        say: told how a plan is approved that waits for it.
    """

    def __init__(self, node: Node, base_frame: str, carried: float, say: Callable[[str], None]) -> None:
        self._base_frame, self._carried, self._say = base_frame, carried, say
        self._owner = f"{node.get_name()}-{uuid.uuid4().hex[:8]}"
        beats = node.create_publisher(String, topics.OWNER_HEARTBEAT, 10)
        self._turned = time.monotonic()
        self._heart = Heartbeat(lambda: beats.publish(String(data=self._owner)), is_alive=self._turns)
        self._action = ActionClient(node, MoveHand, topics.MOVE_HAND)
        node.create_subscription(Empty, topics.HEARTBEAT, self._on_beat, 10)
        self._heard = 0.0  # the executor's last sign of life, or the goal's start [s]
        self._number = 0  # of the goal; what comes of an earlier one is not asked for any more
        self._handle: Any = None
        self._is_waiting = False
        self._end: ActionResult | None = None
        self._approved = ""

    def start(self, target: Pose) -> None:
        """Begin to move the gripper to a pose in the base frame, without a cloud: the camera is not calibrated yet."""
        self._number += 1
        self._end, self._handle, self._is_waiting = None, None, True
        self._heard = time.monotonic()
        if not self._action.server_is_ready():
            words = f"the executor is not there: is it running? (action {topics.MOVE_HAND})"
            self._finish(self._number, ActionResult(Outcome.REJECTED, words))
            return
        goal, number = HandGoal(target, self._carried, blind=True, owner=self._owner), self._number
        sent = self._action.send_goal_async(
            hand_goal_to_msg(goal, self._base_frame), feedback_callback=lambda message: self._on_feedback(message)
        )
        sent.add_done_callback(lambda done: self._on_answer(number, done.result()))

    def end(self) -> ActionResult | None:
        """Return how the motion ended, once it has, and once only; also where the executor falls silent."""
        self._turned = time.monotonic()
        if self._is_waiting and self._turned - self._heard > _SILENT:
            if self._handle is not None:
                self._handle.cancel_goal_async()
            words = f"the executor gives no sign of life for {_SILENT:g} s: is it running?"
            self._finish(self._number, ActionResult(Outcome.EXECUTION_FAILED, words))
        end, self._end = self._end, None
        return end

    def close(self) -> None:
        """End the signs of life, with which a motion ends, too."""
        self._heart.stop()

    def _turns(self) -> bool:
        return time.monotonic() - self._turned < _LONGEST_TURN

    def _on_beat(self, _: Empty) -> None:
        self._heard = time.monotonic()

    def _on_feedback(self, message: Any) -> None:
        feedback = message.feedback
        plan_id = str(feedback.plan_id)
        if feedback.phase != PickPlace.Feedback.PHASE_APPROVAL or plan_id == self._approved:
            return
        self._approved = plan_id
        call = f"ros2 service call {topics.EXECUTOR_APPROVE} cliport_interfaces/srv/ApprovePlan"
        self._say(f"the hand's next motion waits for your approval: {call} \"{{plan_id: '{plan_id}'}}\"")

    def _on_answer(self, number: int, handle: Any) -> None:
        if handle is None or not handle.accepted:
            words = "the executor did not take the goal: it is busy, or stopped (resume ends a stop)"
            self._finish(number, ActionResult(Outcome.REJECTED, words))
            return
        if number != self._number or not self._is_waiting:
            handle.cancel_goal_async()  # it was given up meanwhile
            return
        self._handle = handle
        handle.get_result_async().add_done_callback(lambda done: self._on_result(number, done.result()))

    def _on_result(self, number: int, response: Any) -> None:
        if response is None:
            self._finish(number, ActionResult(Outcome.EXECUTION_FAILED, "the executor gave no result"))
            return
        ended_well = response.status == GoalStatus.STATUS_SUCCEEDED
        self._finish(number, hand_result_from_msg(response.result, ended_well))

    def _finish(self, number: int, end: ActionResult) -> None:
        if number == self._number and self._is_waiting:
            self._end, self._handle, self._is_waiting = end, None, False
