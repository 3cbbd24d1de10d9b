from __future__ import annotations

import pytest
from rclpy.serialization import serialize_message
from sensor_msgs.msg import Image

from cliport_core.errors import ImageError
from cliport_core.messages import stamp_to_msg
from cliport_core.raw_header import header_of_raw


def test_headers_are_read_without_the_rest() -> None:
    message = Image(height=1, width=1, encoding="rgb8", step=3, data=[1, 2, 3])
    message.header.stamp, message.header.frame_id = stamp_to_msg(12_000_000_034), "camera"
    raw = serialize_message(message)
    assert header_of_raw(raw) == (12_000_000_034, "camera")
    with pytest.raises(ImageError, match="of 10 bytes has no header"):
        header_of_raw(raw[:10])


def test_either_byte_order_is_read() -> None:
    assert header_of_raw(bytes.fromhex("00000000 00000002 00000003 00000002 6100")) == (2_000_000_003, "a")


@pytest.mark.parametrize(("length", "frame"), [(0, ""), (1, ""), (2, "b"), (3, "bc")])
def test_a_frame_ends_before_its_terminating_zero(length: int, frame: str) -> None:
    raw = bytes.fromhex("00010000 02000000 03000000") + length.to_bytes(4, "little") + b"bcde"
    assert header_of_raw(raw) == (2_000_000_003, frame)
