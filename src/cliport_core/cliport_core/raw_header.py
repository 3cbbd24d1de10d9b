"""The header of a serialized message, the rest unread."""

from __future__ import annotations

import struct

from cliport_core.errors import ImageError

CDR_HEAD = 4  # bytes of encapsulation before the message; the second says the byte order


def header_of_raw(raw: bytes) -> tuple[int, str]:
    """Return stamp [ns] and frame of a serialized message that begins with a std_msgs/Header.

    Raises:
        ImageError: when it is too short for one.
    """
    order = "<" if len(raw) > 1 and raw[1] & 1 else ">"
    try:
        seconds, nanoseconds, length = struct.unpack_from(f"{order}iII", raw, CDR_HEAD)
    except struct.error:
        raise ImageError(f"a message of {len(raw)} bytes has no header") from None
    begin = CDR_HEAD + 12
    frame = bytes(raw[begin : begin + max(length - 1, 0)]).decode(errors="replace")
    return seconds * 1_000_000_000 + nanoseconds, frame
