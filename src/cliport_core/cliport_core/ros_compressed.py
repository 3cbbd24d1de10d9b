"""Serialized images and compressed images to arrays."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import CompressedImage

from cliport_core.compressed_depth import decode_compressed_depth
from cliport_core.image_files import decode_color_file
from cliport_core.images import decode_color, decode_depth
from cliport_core.messages import image_to_msg
from cliport_core.raw_image import image_of_raw


def color_of_raw(raw: bytes, compressed: bool) -> npt.NDArray[np.uint8]:
    """Return the (H, W, 3) RGB of a serialized Image, or of a CompressedImage of JPEG or PNG. Raises ImageError."""
    if not compressed:
        return decode_color(image_of_raw(raw))
    return decode_color_file(bytes(deserialize_message(raw, CompressedImage).data))


def depth_of_raw(raw: bytes, compressed: bool) -> npt.NDArray[np.float32]:
    """Return the depth (H, W) [m] of a serialized Image, or of a compressedDepth CompressedImage. Raises ImageError."""
    if not compressed:
        return decode_depth(image_of_raw(raw))
    message = deserialize_message(raw, CompressedImage)
    return decode_compressed_depth(str(message.format), bytes(message.data))


def image_of_compressed(raw: bytes, is_depth: bool) -> bytes:
    """Return the serialized Image with the pixels and the header of a serialized CompressedImage.

    Colour comes as rgb8; depth as it was packed, 16UC1 [mm] or 32FC1 [m]. Raises ImageError.
    """
    message = deserialize_message(raw, CompressedImage)
    if not is_depth:
        image = image_to_msg(color_of_raw(raw, True), "rgb8")
    elif str(message.format).startswith("16UC1"):
        depth = np.nan_to_num(depth_of_raw(raw, True))
        image = image_to_msg(np.rint(1e3 * depth).astype(np.uint16), "16UC1")
    else:
        image = image_to_msg(depth_of_raw(raw, True), "32FC1")
    image.header = message.header
    serialized: bytes = serialize_message(image)
    return serialized
