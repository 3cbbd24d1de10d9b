"""The executor's actions: each goal enters through the gate and is run by the session."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

from rclpy.action import CancelResponse, GoalResponse
from rclpy.action.server import ServerGoalHandle
from rclpy.callback_groups import CallbackGroup
from rclpy.node import Node

from cliport_core import topics
from cliport_core.ros_action_server import ThreadedActionServer
from cliport_interfaces.action import MoveHand, PickPlace
from panda_executor.gate import Gate
from panda_executor.goal_session import GoalSession

Run = Callable[[ServerGoalHandle, Any], Any]


class GoalServers:
    """Offers PickPlace and MoveHand."""

    def __init__(self, node: Node, session: GoalSession, gate: Gate, group: CallbackGroup) -> None:
        self._gate, self._logger = gate, node.get_logger()
        self._servers = [
            ThreadedActionServer(
                node, kind, name, partial(self._execute, run), callback_group=group,
                goal_callback=self._on_goal, cancel_callback=lambda _: CancelResponse.ACCEPT,
            )
            for kind, name, run in (
                (PickPlace, topics.PICK_PLACE, session.run),
                (MoveHand, topics.MOVE_HAND, session.move_hand),
            )
        ]  # fmt: skip

    def _on_goal(self, _: object) -> GoalResponse:
        refusal = self._gate.enter()
        if refusal is not None:
            self._logger.warning(f"goal rejected: {refusal}")
        return GoalResponse.ACCEPT if refusal is None else GoalResponse.REJECT

    def _execute(self, run: Run, handle: ServerGoalHandle) -> Any:
        try:
            return run(handle, self._logger)
        finally:
            self._gate.leave()
