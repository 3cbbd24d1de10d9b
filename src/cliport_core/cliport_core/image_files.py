"""Pixels to PNG and JPEG files in memory and back; colours are RGB on this side."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from cliport_core.errors import ImageError


def encode_png(pixels: npt.NDArray[Any], options: Sequence[int] = ()) -> bytes:
    """Return the PNG of (H, W, 3) uint8 RGB, or of (H, W) uint8 or uint16; options are OpenCV's, for a smaller file.

    Raises:
        ImageError: when the pixels make no PNG.
    """
    return _encoded(".png", pixels, options)


def encode_jpeg(pixels: npt.NDArray[np.uint8], quality: int) -> bytes:
    """Return the JPEG of (H, W, 3) uint8 RGB; quality 0..100. Raises ImageError."""
    return _encoded(".jpg", pixels, (cv2.IMWRITE_JPEG_QUALITY, quality))


def decode_color_file(file: bytes) -> npt.NDArray[np.uint8]:
    """Return the (H, W, 3) uint8 RGB of a PNG or JPEG file. Raises ImageError when it is damaged."""
    return np.asarray(cv2.cvtColor(_decoded(file, cv2.IMREAD_COLOR), cv2.COLOR_BGR2RGB), dtype=np.uint8)


def decode_gray_file(file: bytes) -> npt.NDArray[Any]:
    """Return the (H, W) uint8 or uint16 of a file of one channel, as it was stored.

    Raises:
        ImageError: when it is damaged, or has colours.
    """
    image = _decoded(file, cv2.IMREAD_UNCHANGED)
    if image.ndim != 2:
        raise ImageError(f"an image file has {image.shape[2]} channels where one is expected")
    return image


def _encoded(suffix: str, pixels: npt.NDArray[Any], options: Sequence[int]) -> bytes:
    try:
        image = cv2.cvtColor(pixels, cv2.COLOR_RGB2BGR) if pixels.ndim == 3 else pixels
        done, data = cv2.imencode(suffix, image, list(options))
    except cv2.error as error:
        raise ImageError(f"{pixels.dtype} pixels {pixels.shape} make no {suffix} file: {error.err}") from None
    if not done:
        raise ImageError(f"{pixels.dtype} pixels {pixels.shape} make no {suffix} file")
    return bytes(data)


def _decoded(file: bytes, flags: int) -> npt.NDArray[Any]:
    data = np.frombuffer(file, dtype=np.uint8)
    image = cv2.imdecode(data, flags) if data.size else None
    if image is None:
        raise ImageError(f"{data.size} bytes are no image file that can be read")
    decoded: npt.NDArray[Any] = image
    return decoded
