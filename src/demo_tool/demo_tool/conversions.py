"""Conversions from ROS messages to this package's types; pure functions."""

from __future__ import annotations

import numpy as np
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import JointState
from tf2_msgs.msg import TFMessage

from cliport_core.images import decode_color, decode_depth
from cliport_core.messages import heightmap_from_msg
from cliport_core.raw_image import image_of_raw
from cliport_interfaces.msg import Heightmap as HeightmapMsg
from demo_tool.live_view import ColorImage, DepthImage

_UNSEEN_GREY = 40  # of cells that were not seen


def color_from_raw(raw: bytes) -> ColorImage:
    """Decode a serialized Image into (H, W, 3) RGB. Raises ImageError, EncodingError."""
    return np.array(decode_color(image_of_raw(raw)))  # a copy that can be drawn on


def depth_from_raw(raw: bytes) -> DepthImage:
    """Decode a serialized Image into depth (H, W) [m], NaN where unknown. Raises ImageError, EncodingError."""
    return decode_depth(image_of_raw(raw))


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
