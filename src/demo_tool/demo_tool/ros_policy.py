"""Policy of the station: the policy server's parameter, instruction, status, poses and pictures."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

from geometry_msgs.msg import PoseStamped
from rcl_interfaces.msg import ParameterType
from rcl_interfaces.srv import GetParameters
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import Image
from std_msgs.msg import String

from cliport_core import topics
from cliport_core.messages import planar_pose_from_msg, stamp_from_msg, status_from_msg
from cliport_core.raw_header import header_of_raw
from cliport_interfaces.msg import Heightmap, PolicyStatus
from cliport_interfaces.srv import LoadPolicy
from demo_tool.conversions import color_from_raw, scene_from_raw
from demo_tool.ports import OnAnswer
from demo_tool.ros_requests import call_service
from demo_tool.station import Station


class RosPolicy:
    """A `Policy` that passes the server's messages to the attached station; methods may be called from any thread."""

    def __init__(self, node: Node, base_frame: str, post: Callable[[Callable[[], None]], None]) -> None:
        self._node, self._base_frame, self._post = node, base_frame, post
        self._station: Station | None = None
        self._is_there = False  # as the graph says
        self._parameters = node.create_client(GetParameters, topics.POLICY_PARAMETERS)
        self._loading = node.create_client(LoadPolicy, topics.LOAD_POLICY)
        self._instruction = node.create_publisher(String, topics.INSTRUCTION, 10)

    def attach(self, station: Station) -> None:
        """Pass the server's messages to this station from now on."""
        self._station = station
        node, newest = self._node, QoSProfile(depth=1)
        latched = QoSProfile(depth=5, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self._status = node.create_subscription(PolicyStatus, topics.STATUS, self._on_status, latched)
        node.create_subscription(Heightmap, topics.HEIGHTMAP, self._on_heightmap, newest, raw=True)
        for kind in topics.KINDS:
            node.create_subscription(PoseStamped, topics.POSES[kind], partial(self._on_pose, kind), 2)
            node.create_subscription(
                Image, topics.AFFORDANCES[kind], partial(self._on_affordance, kind), newest, raw=True
            )

    def look(self) -> None:
        """Notice a server that has gone; to be called every second or so once a station is attached."""
        if self._station is None:
            return
        was_there, self._is_there = self._is_there, self._node.count_publishers(self._status.topic_name) > 0
        if was_there and not self._is_there:
            self._station.on_policy_gone()

    def ask_require_approval(self, on_answer: Callable[[bool | None], None]) -> None:
        """Ask for the server's parameter require_approval; answers None where it does not answer."""
        self._post(lambda: self._ask(on_answer))

    def instruct(self, text: str) -> None:
        """Publish an instruction on /cliport/instruction."""
        self._post(lambda: self._instruction.publish(String(data=text)))

    def load(self, checkpoint: str, on_answer: OnAnswer) -> None:
        """Call the server's service for another policy."""
        request = LoadPolicy.Request(checkpoint=checkpoint)
        self._post(lambda: call_service(self._loading, request, on_answer, "the policy server"))

    def _ask(self, on_answer: Callable[[bool | None], None]) -> None:
        if not self._parameters.service_is_ready():
            on_answer(None)
            return
        future = self._parameters.call_async(GetParameters.Request(names=["require_approval"]))
        future.add_done_callback(lambda done: on_answer(_flag_in(done.result())))

    def _on_status(self, message: PolicyStatus) -> None:
        if self._station is not None:
            self._station.on_policy_status(status_from_msg(message))

    def _on_pose(self, kind: str, message: PoseStamped) -> None:
        if self._station is None or message.header.frame_id != self._base_frame:
            return
        try:
            pose = planar_pose_from_msg(message.pose)
        except ValueError as error:
            self._node.get_logger().warning(f"the policy's {kind} pose is ignored: {error}")
            return
        self._station.on_policy_pose(kind, pose, stamp_from_msg(message.header.stamp))

    def _on_heightmap(self, raw: bytes) -> None:
        if self._station is not None:
            self._station.on_heightmap(header_of_raw(raw)[0], partial(scene_from_raw, raw))

    def _on_affordance(self, kind: str, raw: bytes) -> None:
        if self._station is not None:
            self._station.on_affordance(kind, header_of_raw(raw)[0], partial(color_from_raw, raw))


def _flag_in(response: Any) -> bool | None:
    values = response.values if response is not None else []
    if len(values) != 1 or values[0].type != ParameterType.PARAMETER_BOOL:
        return None
    return bool(values[0].bool_value)
