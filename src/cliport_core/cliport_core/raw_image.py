"""The pixels of a serialized sensor_msgs/Image, where they lie: nothing is copied."""

from __future__ import annotations

import struct

from cliport_core.errors import ImageError
from cliport_core.images import ImageBuffer
from cliport_core.raw_header import CDR_HEAD


def image_of_raw(raw: bytes) -> ImageBuffer:
    """Return the image of a serialized message; its data is a view of `raw`.

    Raises:
        ImageError: when the bytes are no Image, or end before its last pixel.
    """
    order = "<" if len(raw) > 1 and raw[1] & 1 else ">"
    try:
        (length,) = struct.unpack_from(f"{order}I", raw, CDR_HEAD + 8)  # after the stamp: the frame's name
        at = _aligned(CDR_HEAD + 12 + length)
        height, width, length = struct.unpack_from(f"{order}III", raw, at)
        encoding = bytes(raw[at + 12 : at + 12 + max(length - 1, 0)]).decode("ascii", errors="replace")
        at += 12 + length
        is_bigendian = bool(raw[at])
        step, size = struct.unpack_from(f"{order}II", raw, _aligned(at + 1))
        begin = _aligned(at + 1) + 8
    except (struct.error, IndexError):
        raise ImageError(f"a message of {len(raw)} bytes is no image") from None
    if begin + size > len(raw):
        raise ImageError(f"an image announces {size} bytes of pixels, and {max(len(raw) - begin, 0)} came")
    return ImageBuffer(memoryview(raw)[begin : begin + size], height, width, step, encoding, is_bigendian)


def _aligned(offset: int) -> int:
    """Return the next offset at which a number of four bytes may begin, counted from the end of the encapsulation."""
    return CDR_HEAD + (offset - CDR_HEAD + 3) // 4 * 4
