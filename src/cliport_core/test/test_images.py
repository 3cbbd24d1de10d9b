from __future__ import annotations

import numpy as np
import pytest

from cliport_core import EncodingError, ImageError
from cliport_core.images import ImageBuffer, decode_color, decode_depth

RGB = np.random.default_rng(0).integers(0, 256, (7, 5, 3), dtype=np.uint8)
MILLIMETRES = np.array([[0, 1, 1234], [65535, 300, 0]], dtype=np.uint16)


def padded(pixels: np.ndarray, encoding: str, padding: int = 0, big: bool = False) -> ImageBuffer:
    rows = pixels.reshape(pixels.shape[0], -1)
    if big:
        rows = rows.astype(rows.dtype.newbyteorder(">"))
    data = b"".join(row.tobytes() + b"\xff" * padding for row in rows)
    step = rows.shape[1] * rows.dtype.itemsize + padding
    return ImageBuffer(memoryview(data), pixels.shape[0], pixels.shape[1], step, encoding, big)


@pytest.mark.parametrize("padding", [0, 3])
@pytest.mark.parametrize("encoding", ["rgb8", "bgr8", "rgba8", "bgra8"])
def test_every_colour_encoding_gives_the_same_rgb(encoding: str, padding: int) -> None:
    pixels = RGB[..., ::-1] if encoding.startswith("bgr") else RGB
    if encoding.endswith("a8"):
        pixels = np.concatenate([pixels, np.full((7, 5, 1), 77, np.uint8)], axis=-1)
    np.testing.assert_array_equal(decode_color(padded(pixels, encoding, padding)), RGB)


@pytest.mark.parametrize("padding", [0, 2])
@pytest.mark.parametrize("big", [False, True])
def test_millimetres_and_metres_agree(big: bool, padding: int) -> None:
    expected = np.where(MILLIMETRES == 0, np.nan, MILLIMETRES * 1e-3).astype(np.float32)
    from_mm = decode_depth(padded(MILLIMETRES, "16UC1", padding, big))
    from_m = decode_depth(padded(expected, "32FC1", 2 * padding, big))
    np.testing.assert_allclose(from_mm, expected, rtol=1e-6)
    np.testing.assert_allclose(from_m, expected, rtol=1e-6)
    assert from_mm.dtype == from_m.dtype == np.float32
    assert from_m.dtype.isnative


def test_everything_that_is_no_distance_becomes_nan() -> None:
    depth = np.array([[np.nan, np.inf, -np.inf, 0.0, -1.0, 3e38, 1.5]], dtype=np.float32)
    decoded = decode_depth(padded(depth, "32FC1"))
    assert np.isnan(decoded[0, :6]).all()
    assert decoded[0, 6] == 1.5


def test_millimetres_that_should_be_metres_are_named_and_filler_is_only_unknown() -> None:
    depth = np.array([[np.nan, 0.0, 812.0, 905.4, 990.0]], dtype=np.float32)
    with pytest.raises(ImageError, match=r"depth is 905 m in the median, 100 m at most: is it in millimetres\?"):
        decode_depth(padded(depth, "32FC1"))
    for unknown in (np.full((1, 3), np.float32(1e9)), np.zeros((1, 3), np.float32)):
        assert np.isnan(decode_depth(padded(unknown, "32FC1"))).all()


def test_unsupported_encodings_name_what_came_and_what_works() -> None:
    with pytest.raises(EncodingError, match="'mono8'; supported are rgb8, bgr8, rgba8, bgra8"):
        decode_color(padded(RGB[..., 0], "mono8"))
    with pytest.raises(EncodingError, match="'64FC1'; supported are 32FC1, 16UC1"):
        decode_depth(padded(MILLIMETRES, "64FC1"))


@pytest.mark.parametrize(("height", "step"), [(3, 6), (2, 5), (0, 6), (2, 0)])
def test_buffers_that_are_too_small_are_refused(height: int, step: int) -> None:
    buffer = ImageBuffer(memoryview(MILLIMETRES.tobytes()), height, 3, step, "16UC1", False)
    with pytest.raises(ImageError, match="16UC1 image"):
        decode_depth(buffer)
