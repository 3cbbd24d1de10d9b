"""A subscription that is as reliable as its publishers are."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.subscription import Subscription

# Messages that wait for a reader that is behind. Fast DDS keeps the room of as many, megabytes for each picture.
QUEUE = 2


class AdaptiveSubscription:
    """Best effort, which takes what any camera driver publishes; reliable once all publishers offer that.

    Best effort alone loses most images of a megabyte or more: one lost fragment loses the image.

    raw: the callback is given the serialized bytes.
    """

    def __init__(
        self, node: Node, message_type: type, topic: str, callback: Callable[[Any], None], raw: bool = False
    ) -> None:
        self._node = node
        self._message_type = message_type
        self._topic = topic
        self._callback = callback
        self._raw = raw
        self._reliable = False
        self._subscription = self._subscribe()

    @property
    def topic_name(self) -> str:
        """The topic's name after remapping."""
        return str(self._subscription.topic_name)

    @property
    def is_reliable(self) -> bool:
        """True if lost fragments are sent again."""
        return self._reliable

    def adapt(self) -> None:
        """Look at the publishers; call now and then."""
        publishers = self._node.get_publishers_info_by_topic(self._topic)
        offered = [info.qos_profile.reliability for info in publishers]
        reliable = bool(offered) and all(policy == ReliabilityPolicy.RELIABLE for policy in offered)
        if reliable != self._reliable and offered:
            self._reliable = reliable
            self._node.destroy_subscription(self._subscription)
            self._subscription = self._subscribe()

    def _subscribe(self) -> Subscription:
        policy = ReliabilityPolicy.RELIABLE if self._reliable else ReliabilityPolicy.BEST_EFFORT
        profile = QoSProfile(depth=QUEUE, reliability=policy)
        return self._node.create_subscription(self._message_type, self._topic, self._callback, profile, raw=self._raw)
