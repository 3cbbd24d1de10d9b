from __future__ import annotations

import numpy as np
import pytest

from cliport_core.errors import ImageError
from cliport_core.image_files import decode_color_file, decode_gray_file, encode_jpeg, encode_png

RNG = np.random.default_rng(0)


def test_colours_survive_a_png() -> None:
    pixels = RNG.integers(0, 256, (5, 7, 3), dtype=np.uint8)
    np.testing.assert_array_equal(decode_color_file(encode_png(pixels)), pixels)


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_one_channel_survives_a_png(dtype: type) -> None:
    pixels = RNG.integers(0, np.iinfo(dtype).max, (5, 7), dtype=dtype)
    back = decode_gray_file(encode_png(pixels))
    assert back.dtype == dtype
    np.testing.assert_array_equal(back, pixels)


def test_a_jpeg_keeps_red_red_and_quality_costs_bytes() -> None:
    red = np.zeros((32, 32, 3), np.uint8)
    red[..., 0] = 200
    back = decode_color_file(encode_jpeg(red, 90))
    assert np.abs(back.astype(int) - red).max() < 12
    noise = RNG.integers(0, 256, (64, 64, 3), dtype=np.uint8)
    assert len(encode_jpeg(noise, 20)) < len(encode_jpeg(noise, 90))


@pytest.mark.parametrize("file", [b"", b"nonsense", encode_png(np.zeros((9, 9), np.uint8))[:20]])
def test_damaged_files_are_refused(file: bytes) -> None:
    for decode in (decode_color_file, decode_gray_file):
        with pytest.raises(ImageError, match=f"{len(file)} bytes are no image file"):
            decode(file)


def test_what_makes_no_file_is_refused() -> None:
    with pytest.raises(ImageError, match="has 3 channels where one"):
        decode_gray_file(encode_png(np.zeros((2, 2, 3), np.uint8)))
    with pytest.raises(ImageError, match=r"pixels \(0, 4\) make no .png"):
        encode_png(np.zeros((0, 4), np.uint8))
