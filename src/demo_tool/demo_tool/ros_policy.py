"""The policy server as the station's policy: how it is set, its instruction, what it says and shows."""

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

from cliport_interfaces.msg import Heightmap, PolicyStatus
from cliport_perception.conversions import stamp_from_msg
from cliport_perception.raw_header import header_of_raw
from demo_tool.conversions import (
    color_from_raw,
    confidence_from_msg,
    planar_pose_from_msg,
    policy_state_from_msg,
    scene_from_raw,
)
from demo_tool.station import Station

_SERVER = "cliport_policy"
_KINDS = ("pick", "place")


class RosPolicy:
    """A `Policy`; what it hears goes to the station that is attached. Methods may be called from any thread."""

    def __init__(self, node: Node, base_frame: str, post: Callable[[Callable[[], None]], None]) -> None:
        self._node, self._base_frame, self._post = node, base_frame, post
        self._station: Station | None = None
        self._parameters = node.create_client(GetParameters, f"/{_SERVER}/get_parameters")
        self._instruction = node.create_publisher(String, "/cliport/instruction", 10)

    def attach(self, station: Station) -> None:
        """Hear the server for this station from now on."""
        self._station = station
        node, newest = self._node, QoSProfile(depth=1)
        latched = QoSProfile(depth=5, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        node.create_subscription(PolicyStatus, "/cliport/status", self._on_status, latched)
        node.create_subscription(Heightmap, "/cliport/heightmap", self._on_heightmap, newest, raw=True)
        for kind in _KINDS:
            node.create_subscription(PoseStamped, f"/cliport/{kind}_pose", partial(self._on_pose, kind), 2)
            node.create_subscription(
                Image, f"/cliport/affordance/{kind}", partial(self._on_affordance, kind), newest, raw=True
            )

    def ask_whether_it_waits(self, on_answer: Callable[[bool | None], None]) -> None:
        """Whether its parameter require_approval is set; None: it does not answer."""
        self._post(lambda: self._ask(on_answer))

    def instruct(self, text: str) -> None:
        """Publish on /cliport/instruction."""
        self._post(lambda: self._instruction.publish(String(data=text)))

    def _ask(self, on_answer: Callable[[bool | None], None]) -> None:
        if not self._parameters.service_is_ready():
            on_answer(None)
            return
        future = self._parameters.call_async(GetParameters.Request(names=["require_approval"]))
        future.add_done_callback(lambda done: on_answer(_truth(done.result())))

    def _on_status(self, message: PolicyStatus) -> None:
        if self._station is not None:
            state = policy_state_from_msg(message)
            words, instruction = str(message.message), str(message.instruction)
            self._station.on_policy_status(state, words, instruction, confidence_from_msg(message))

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


def _truth(response: Any) -> bool | None:
    values = response.values if response is not None else []
    if len(values) != 1 or values[0].type != ParameterType.PARAMETER_BOOL:
        return None
    return bool(values[0].bool_value)
