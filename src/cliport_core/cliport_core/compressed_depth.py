"""Depth images as image_transport's compressedDepth packs them: a small header, then a PNG of 16 bits."""

from __future__ import annotations

import struct

import numpy as np
import numpy.typing as npt

from cliport_core.errors import EncodingError, ImageError
from cliport_core.image_files import decode_gray_file, encode_png
from cliport_core.images import DEPTH_ENCODINGS, MAX_DEPTH_M

_HEAD = "<iff"  # kind of compression, then two numbers that a packed 32FC1 is unpacked with
_FORMAT = "compressedDepth"


def decode_compressed_depth(form: str, data: bytes) -> npt.NDArray[np.float32]:
    """Return (H, W) float32 [m] along the optical axis, NaN where unknown.

    form: a CompressedImage's format, such as `16UC1; compressedDepth png`; data: its content. 32FC1 is packed as
    inverse depth, `number = a / depth + b`, with 0 where unknown.

    Raises:
        EncodingError: unless the packed encoding is one of `DEPTH_ENCODINGS`.
        ImageError: when the format is another, or the data are damaged.
    """
    encoding, _, packing = (part.strip() for part in form.partition(";"))
    if not packing.startswith(_FORMAT) or "rvl" in packing.lower():
        raise ImageError(f"depth has format '{form}'; 'compressedDepth png' is supported")
    if encoding not in DEPTH_ENCODINGS:
        raise EncodingError("compressed depth", encoding, DEPTH_ENCODINGS)
    if len(data) <= struct.calcsize(_HEAD):
        raise ImageError(f"compressed depth of {len(data)} bytes holds no image")
    _, a, b = struct.unpack_from(_HEAD, data)
    numbers = decode_gray_file(data[struct.calcsize(_HEAD) :]).astype(np.float32)
    known = numbers > 0.0
    with np.errstate(divide="ignore", invalid="ignore"):
        depth: npt.NDArray[np.float32] = (
            numbers * np.float32(1e-3) if encoding == "16UC1" else np.float32(a) / (numbers - np.float32(b))
        )
    depth[~(known & (depth > 0.0) & (depth < MAX_DEPTH_M))] = np.nan
    return depth


def encode_compressed_depth(depth_m: npt.NDArray[np.float32], encoding: str) -> tuple[str, bytes]:
    """Return format and data for depth (H, W) [m], NaN where unknown: 16UC1 in millimetres, or 32FC1.

    Raises:
        EncodingError: for another encoding.
    """
    if encoding not in DEPTH_ENCODINGS:
        raise EncodingError("depth to be compressed", encoding, DEPTH_ENCODINGS)
    a = b = 0.0
    with np.errstate(divide="ignore", invalid="ignore"):
        if encoding == "16UC1":
            numbers = depth_m * 1e3
        else:
            plane, most = 100.0, 10.0  # of image_transport's defaults: quantization, farthest depth [m]
            a = plane * (plane + 1.0)
            b = 1.0 - a / most
            numbers = a / depth_m + b
    packed = np.nan_to_num(np.rint(numbers), nan=0.0, posinf=0.0, neginf=0.0).clip(0, 65535).astype(np.uint16)
    return f"{encoding}; {_FORMAT} png", struct.pack(_HEAD, 0, a, b) + encode_png(packed)
