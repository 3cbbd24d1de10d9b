"""The camera's colour for a calibration, raw or compressed."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from rclpy.node import Node
from sensor_msgs.msg import CompressedImage, Image

from cliport_core import topics
from cliport_core.adaptive_subscription import AdaptiveSubscription
from cliport_core.raw_header import header_of_raw
from cliport_core.ros_compressed import color_of_raw
from cliport_core.ros_rgbd import COMPRESSED_BELOW


class RosPicture(NamedTuple):
    """A serialized picture, undecoded."""

    data: bytes
    compressed: bool

    @property
    def header(self) -> tuple[int, str]:
        """Stamp [ns] and frame. Raises ImageError when the message has none."""
        return header_of_raw(self.data)

    def color(self) -> npt.NDArray[np.uint8]:
        """Return (H, W, 3) RGB. Raises ImageError, EncodingError."""
        return color_of_raw(self.data, self.compressed)


def subscribe_pictures(node: Node, on_picture: Callable[[RosPicture], None]) -> AdaptiveSubscription:
    """Begin to receive colour, or the compressed pictures below it where the node's parameter `compressed` is set."""
    compressed = bool(node.declare_parameter("compressed", False).value)
    topic = topics.COLOR + (COMPRESSED_BELOW["color"] if compressed else "")
    kind = CompressedImage if compressed else Image
    return AdaptiveSubscription(node, kind, topic, lambda raw: on_picture(RosPicture(raw, compressed)), raw=True)
