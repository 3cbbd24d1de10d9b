"""A process with nodes for the tests of `ros2`: `python ros2_graph_process.py NUMBER` or `… action`."""

from __future__ import annotations

import sys
import time
from typing import Any

import rclpy
from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.executors import MultiThreadedExecutor
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from rclpy.signals import SignalHandlerOptions
from std_msgs.msg import String

from cliport_interfaces.action import PickPlace

NODES, TOPICS = 2, 3  # of a process


def topic_names(processes: int) -> set[str]:
    """Return the topics that some processes publish."""
    return {f"/p{p}/n{n}/t{t}" for p in range(processes) for n in range(NODES) for t in range(TOPICS)}


def publishing_nodes(process: int) -> list[Node]:
    """Make nodes that publish topics; the first one's topics are best effort. It has a parameter of each type."""
    nodes = [Node(f"n{number}", namespace=f"/p{process}") for number in range(NODES)]
    for number, node in enumerate(nodes):
        profile = 10 if number else qos_profile_sensor_data
        for topic in range(TOPICS):
            node.create_publisher(String, f"/p{process}/n{number}/t{topic}", profile)
    talker = nodes[0].create_publisher(String, f"/p{process}/talk", qos_profile_sensor_data)
    if process == 0:  # nobody listens to the others
        nodes[0].create_timer(0.1, lambda: talker.publish(String(data="said")))
    nodes[0].create_subscription(String, f"/p{process}/hear", lambda _message: None, 10)
    for name, value in {"speed": 0.5, "label": "fast", "count": 3, "on": True, "names": ["a", "b"]}.items():
        nodes[0].declare_parameter(f"motor.{name}" if name == "speed" else name, value)
    return nodes


class PickPlaceNode(Node):
    """Serves an action: its goals succeed after two feedbacks; "wait" waits to be canceled, "never" is rejected.

    Before the two there is one of somebody else's goal.
    """

    def __init__(self) -> None:
        super().__init__("server", namespace="/arm")
        self._server = ActionServer(
            self, PickPlace, "/pick_place", self._execute,
            goal_callback=self._accept, cancel_callback=lambda _goal: CancelResponse.ACCEPT,
            callback_group=ReentrantCallbackGroup(),
        )  # fmt: skip
        self._others = self.create_publisher(PickPlace.Impl.FeedbackMessage, "/pick_place/_action/feedback", 10)

    def _accept(self, request: Any) -> GoalResponse:
        return GoalResponse.REJECT if request.instruction == "never" else GoalResponse.ACCEPT

    def _execute(self, goal: Any) -> Any:
        if goal.request.instruction == "wait":
            print("waiting", flush=True)
            while rclpy.ok() and not goal.is_cancel_requested:
                time.sleep(0.02)
            goal.canceled()
            print("canceled", flush=True)
            return PickPlace.Result(message="canceled")
        other = PickPlace.Feedback(phase_name="descend", progress=0.75)
        self._others.publish(PickPlace.Impl.FeedbackMessage(feedback=other))
        for progress in (0.25, 0.5):
            goal.publish_feedback(PickPlace.Feedback(phase_name="descend", progress=progress))
        goal.succeed()
        return PickPlace.Result(message="done")


def main(what: str) -> None:
    """Spin the nodes until SIGTERM ends the process at once: rclpy's own handler may never return."""
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    nodes: list[Node] = [PickPlaceNode()] if what == "action" else publishing_nodes(int(what))
    executor = MultiThreadedExecutor(4)  # a test that failed and its next tries may each leave a goal waiting
    for node in nodes:
        executor.add_node(node)
    print("ready", flush=True)
    executor.spin()


if __name__ == "__main__":
    main(sys.argv[1])
