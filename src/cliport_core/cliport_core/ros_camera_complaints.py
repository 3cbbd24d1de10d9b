"""The sentences with which perception refuses cameras, as diagnostics bring them to who would act on what is seen."""

from __future__ import annotations

from collections.abc import Callable

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.callback_groups import CallbackGroup
from rclpy.node import Node

from cliport_core import topics
from cliport_core.messages import stamp_from_msg

Complain = Callable[[str, int], None]  # a sentence, and its time [ns, ROS time]


def hear_camera_complaints(node: Node, complain: Complain, group: CallbackGroup | None = None) -> None:
    """Subscribe a node to them; group: of its callbacks."""

    def on_report(message: DiagnosticArray) -> None:
        for words in camera_complaints(message):
            complain(words, stamp_from_msg(message.header.stamp))

    node.create_subscription(DiagnosticArray, topics.DIAGNOSTICS, on_report, 20, callback_group=group)


def camera_complaints(message: DiagnosticArray) -> list[str]:
    """Return a sentence for each camera that the message says is refused; empty where it says nothing of the kind."""
    errors = [status for status in message.status if status.level == DiagnosticStatus.ERROR]
    refused = [status.message for status in errors if status.name.startswith(topics.CAMERA_STATUS)]
    return [f"perception refuses the camera's data: {words}" for words in refused]
