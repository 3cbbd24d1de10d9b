"""The executor as what moves the hand during a calibration."""

from __future__ import annotations

import time
import uuid
from collections.abc import Callable
from typing import Any

from action_msgs.msg import GoalStatus
from rclpy.action import ActionClient
from rclpy.node import Node
from std_msgs.msg import String

from cliport_core import topics
from cliport_core.action import HandGoal
from cliport_core.heartbeat import Heartbeat
from cliport_core.messages_hand import hand_goal_to_msg, hand_result_from_msg
from cliport_core.outcome import ActionResult, Outcome
from cliport_core.pose import Pose
from cliport_interfaces.action import MoveHand

_LONGEST_TURN = 3.0  # of the thread that spins, before it counts as hung [s]


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
        self._end: ActionResult | None = None
        self._approved = ""

    def start(self, target: Pose) -> None:
        """Begin to move the gripper to a pose in the base frame, without a cloud: the camera is not calibrated yet."""
        self._end = None
        if not self._action.server_is_ready():
            words = f"the executor is not there: is it running? (action {topics.MOVE_HAND})"
            self._end = ActionResult(Outcome.REJECTED, words)
            return
        goal = HandGoal(target, self._carried, blind=True, owner=self._owner)
        sent = self._action.send_goal_async(
            hand_goal_to_msg(goal, self._base_frame), feedback_callback=lambda message: self._on_feedback(message)
        )
        sent.add_done_callback(lambda done: self._on_answer(done.result()))

    def end(self) -> ActionResult | None:
        """Return how the motion ended, once it has, and once only."""
        self._turned = time.monotonic()
        end, self._end = self._end, None
        return end

    def close(self) -> None:
        """End the signs of life, with which a motion ends, too."""
        self._heart.stop()

    def _turns(self) -> bool:
        return time.monotonic() - self._turned < _LONGEST_TURN

    def _on_feedback(self, message: Any) -> None:
        feedback = message.feedback
        plan_id = str(feedback.plan_id)
        if feedback.phase_name != "APPROVAL" or plan_id == self._approved:
            return
        self._approved = plan_id
        call = f"ros2 service call {topics.EXECUTOR_APPROVE} cliport_interfaces/srv/ApprovePlan"
        self._say(f"the hand's next motion waits for your approval: {call} \"{{plan_id: '{plan_id}'}}\"")

    def _on_answer(self, handle: Any) -> None:
        if handle is None or not handle.accepted:
            words = "the executor did not take the goal: it is busy, or stopped (resume ends a stop)"
            self._end = ActionResult(Outcome.REJECTED, words)
            return
        handle.get_result_async().add_done_callback(lambda done: self._on_result(done.result()))

    def _on_result(self, response: Any) -> None:
        if response is None:
            self._end = ActionResult(Outcome.EXECUTION_FAILED, "the executor gave no result")
            return
        self._end = hand_result_from_msg(response.result, response.status == GoalStatus.STATUS_SUCCEEDED)
