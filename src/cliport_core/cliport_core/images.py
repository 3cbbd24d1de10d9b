"""Raw image buffers, as cameras publish them, to arrays."""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np
import numpy.typing as npt

from cliport_core.errors import EncodingError, ImageError

MAX_DEPTH_M = 100.0  # anything farther is an overflow or a filler value, not a surface [m]
_TO_RGB: dict[str, int | None] = {
    "rgb8": None,
    "bgr8": cv2.COLOR_BGR2RGB,
    "rgba8": cv2.COLOR_RGBA2RGB,
    "bgra8": cv2.COLOR_BGRA2RGB,
}
COLOR_ENCODINGS = tuple(_TO_RGB)
DEPTH_ENCODINGS = ("32FC1", "16UC1")


class ImageBuffer(NamedTuple):
    """One image as it travels: `step` bytes a row, which may be more than the pixels need."""

    data: memoryview
    height: int
    width: int
    step: int
    encoding: str
    is_bigendian: bool


def decode_color(image: ImageBuffer) -> npt.NDArray[np.uint8]:
    """Return (H, W, 3) uint8 RGB.

    Raises:
        EncodingError: unless the encoding is one of `COLOR_ENCODINGS`.
        ImageError: when the buffer is smaller than size and step say.
    """
    if image.encoding not in _TO_RGB:
        raise EncodingError("colour", image.encoding, COLOR_ENCODINGS)
    code = _TO_RGB[image.encoding]
    channels = 4 if "a" in image.encoding else 3
    pixels = _pixels(image, np.dtype(np.uint8), channels)
    rgb = np.ascontiguousarray(pixels)
    return rgb if code is None else np.asarray(cv2.cvtColor(rgb, code), dtype=np.uint8)


def decode_depth(image: ImageBuffer) -> npt.NDArray[np.float32]:
    """Return (H, W) float32 [m] along the optical axis, NaN where unknown (REP 118: 32FC1 m or 16UC1 mm).

    Raises:
        EncodingError: unless the encoding is one of `DEPTH_ENCODINGS`.
        ImageError: when the buffer is smaller than size and step say, or all depth lies farther than any is used.
    """
    if image.encoding not in DEPTH_ENCODINGS:
        raise EncodingError("depth", image.encoding, DEPTH_ENCODINGS)
    if image.encoding == "16UC1":
        depth = _pixels(image, np.dtype(np.uint16), 1)[..., 0].astype(np.float32) * np.float32(1e-3)
    else:
        depth = _pixels(image, np.dtype(np.float32), 1)[..., 0].astype(np.float32)
    used = (depth > 0.0) & (depth < MAX_DEPTH_M)
    if not used.any():
        _check_unit(depth)
    depth[~used] = np.nan
    return depth


def _check_unit(depth: npt.NDArray[np.float32]) -> None:
    """Refuse depth (H, W), of which nothing is used, where its numbers are those of millimetres."""
    known = depth[np.isfinite(depth) & (depth > 0.0)]
    middle = float(np.median(known)) if known.size else 0.0
    if MAX_DEPTH_M <= middle < 1e3 * MAX_DEPTH_M:
        raise ImageError(
            f"depth is {middle:.0f} m in the median, {MAX_DEPTH_M:.0f} m at most: is it in millimetres? 32FC1 must "
            "hold metres"
        )


def _pixels(image: ImageBuffer, dtype: np.dtype[np.generic], channels: int) -> npt.NDArray[np.generic]:
    """Return a view (H, W, channels) that honours the row step and the byte order."""
    row_bytes = image.width * channels * dtype.itemsize
    size = image.data.nbytes
    if image.height < 1 or image.width < 1:
        raise ImageError(f"{image.encoding} image is empty ({image.width}x{image.height})")
    if image.step < row_bytes or size < image.step * (image.height - 1) + row_bytes:
        raise ImageError(
            f"{image.encoding} image of {image.width}x{image.height} pixels and step {image.step} "
            f"needs {row_bytes} bytes a row, and {size} bytes came"
        )
    order = dtype.newbyteorder(">" if image.is_bigendian else "<")
    return np.ndarray(
        (image.height, image.width, channels),
        order,
        image.data,
        strides=(image.step, channels * dtype.itemsize, dtype.itemsize),
    )
