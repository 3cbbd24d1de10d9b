from __future__ import annotations

import numpy as np
import pytest
from rclpy.serialization import serialize_message

from cliport_core.errors import ImageError
from cliport_core.images import decode_color, decode_depth
from cliport_core.messages import color_from_msg, depth_from_msg, image_to_msg
from cliport_core.raw_image import image_of_raw

RNG = np.random.default_rng(0)


@pytest.mark.parametrize("frame", ["", "c", "camera", "camera_color_optical_frame"])
@pytest.mark.parametrize("encoding", ["rgb8", "bgr8", "rgba8"])
def test_colours_are_those_of_the_decoded_message(frame: str, encoding: str) -> None:
    channels = 4 if "a" in encoding else 3
    message = image_to_msg(RNG.integers(0, 256, (5, 7, channels), dtype=np.uint8), encoding)
    message.header.frame_id = frame
    raw = serialize_message(message)
    np.testing.assert_array_equal(decode_color(image_of_raw(raw)), color_from_msg(message))


@pytest.mark.parametrize("dtype", ["<f4", "<u2"])
def test_depths_are_those_of_the_decoded_message(dtype: str) -> None:
    message = image_to_msg((RNG.random((6, 3)) * 4).astype(dtype), {"<f4": "32FC1", "<u2": "16UC1"}[dtype])
    message.header.frame_id = "abc"
    raw = serialize_message(message)
    np.testing.assert_array_equal(decode_depth(image_of_raw(raw)), depth_from_msg(message))
    assert not image_of_raw(raw).is_bigendian


def test_nothing_is_copied() -> None:
    raw = bytes(serialize_message(image_to_msg(np.zeros((4, 4, 3), np.uint8), "rgb8")))
    assert image_of_raw(raw).data.obj is raw


def test_what_is_no_image_is_refused() -> None:
    raw = bytes(serialize_message(image_to_msg(np.zeros((4, 4, 3), np.uint8), "rgb8")))
    for end in (0, 3, 11, 20, 30, 36):
        with pytest.raises(ImageError, match="is no image"):
            image_of_raw(raw[:end])
    with pytest.raises(ImageError, match="announces 48 bytes of pixels, and 38 came"):
        image_of_raw(raw[:-10])


@pytest.mark.parametrize("encoding", ["x", "xy", "xyz", "mono", "mono8", "mono16"])
@pytest.mark.parametrize("frame", ["", "a", "ab", "abc"])
def test_every_alignment_of_the_pixels_is_found(encoding: str, frame: str) -> None:
    """The lengths of two texts decide where step, size and pixels begin."""
    message = image_to_msg(RNG.integers(0, 256, (3, 5, 3), dtype=np.uint8), "rgb8")
    message.header.frame_id, message.encoding = frame, encoding
    image = image_of_raw(bytes(serialize_message(message)))
    assert (image.height, image.width, image.step, image.encoding) == (3, 5, 15, encoding)
    assert bytes(image.data) == bytes(message.data)
