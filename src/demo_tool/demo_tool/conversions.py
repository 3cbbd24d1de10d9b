"""Conversions from ROS messages to this package's types; pure functions."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import JointState
from tf2_msgs.msg import TFMessage

from cliport_core import topics
from cliport_core.messages import heightmap_from_msg
from cliport_core.ros_compressed import color_of_raw, image_of_compressed
from cliport_episodes.raw import RawMessage
from cliport_interfaces.msg import Heightmap as HeightmapMsg
from demo_tool.live_view import ColorImage

IMAGE, COMPRESSED = "sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage"

_UNSEEN_GREY = 40  # of cells that were not seen


def color_from_raw(raw: bytes, compressed: bool = False) -> ColorImage:
    """Decode a serialized Image or CompressedImage into (H, W, 3) RGB. Raises ImageError, EncodingError."""
    return np.array(color_of_raw(raw, compressed))  # a copy that can be drawn on


def recordable(message: RawMessage) -> RawMessage:
    """Return a compressed picture as the raw one that is recorded, any other message as it is. Raises ImageError."""
    if message.type != COMPRESSED:
        return message
    unpacked = image_of_compressed(message.data, message.topic == topics.DEPTH)
    return replace(message, type=IMAGE, data=unpacked)


def joint_names_from_raw(raw: bytes) -> tuple[str, ...]:
    """Return the joint names of a serialized JointState."""
    message: JointState = deserialize_message(raw, JointState)
    return tuple(message.name)


def joint_positions_from_raw(raw: bytes) -> dict[str, float]:
    """Return the positions [rad, m] of a serialized JointState by the joints' names."""
    message: JointState = deserialize_message(raw, JointState)
    return dict(zip(message.name, map(float, message.position)))  # a state may lack positions


def transforms_from_raw(raw: bytes) -> TFMessage:
    """Deserialize a TFMessage."""
    message: TFMessage = deserialize_message(raw, TFMessage)
    return message


def scene_from_raw(raw: bytes) -> ColorImage:
    """Return the colours of a serialized Heightmap as seen from behind the robot: +x up, +y to the left.

    Raises:
        CoreError: when the message is no heightmap.
    """
    heightmap = heightmap_from_msg(deserialize_message(raw, HeightmapMsg))
    color = np.where(heightmap.valid[..., None], heightmap.color, np.uint8(_UNSEEN_GREY))
    return np.ascontiguousarray(np.swapaxes(color, 0, 1)[::-1, ::-1])
