"""The sentences with which perception refuses cameras, as diagnostics bring them to who would act on what is seen."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.node import Node

from cliport_core import topics
from cliport_core.messages import stamp_from_msg

Complain = Callable[[str, int], None]  # a sentence, and its time [ns, ROS time]


def hear_camera_complaints(node: Node, complain: Complain) -> None:
    """Subscribe a node to them."""
    node.create_subscription(DiagnosticArray, topics.DIAGNOSTICS, partial(pass_complaints_on, complain), 20)


def pass_complaints_on(complain: Complain, message: DiagnosticArray) -> None:
    """Call `complain` for each camera that the message says is refused."""
    for words in camera_complaints(message):
        complain(words, stamp_from_msg(message.header.stamp))


def camera_complaints(message: DiagnosticArray) -> list[str]:
    """Return a sentence for each camera that the message says is refused; empty where it says nothing of the kind."""
    errors = [status for status in message.status if status.level == DiagnosticStatus.ERROR]
    refused = [status.message for status in errors if status.name.startswith(topics.CAMERA_STATUS)]
    return [f"perception refuses the camera's data: {words}" for words in refused]
