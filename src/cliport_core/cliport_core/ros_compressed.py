"""Serialized images and compressed images to arrays."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import CompressedImage

from cliport_core.compressed_depth import decode_compressed_depth
from cliport_core.image_files import decode_color_file
from cliport_core.images import decode_color, decode_depth
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
