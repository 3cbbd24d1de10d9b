from __future__ import annotations

import struct

import numpy as np
import pytest

from cliport_core import EncodingError, ImageError
from cliport_core.compressed_depth import decode_compressed_depth, encode_compressed_depth


def ramp() -> np.ndarray:
    depth = np.linspace(0.4, 4.0, 30 * 40, dtype=np.float32).reshape(30, 40)
    depth[3, 5] = np.nan
    return depth


@pytest.mark.parametrize(("encoding", "error"), [("16UC1", 5.1e-4), ("32FC1", 2e-3)])
def test_depth_comes_back_and_unknown_stays_unknown(encoding: str, error: float) -> None:
    depth = ramp()
    back = decode_compressed_depth(*encode_compressed_depth(depth, encoding))
    assert back.dtype == np.float32 and back.shape == depth.shape
    np.testing.assert_array_equal(np.isnan(back), np.isnan(depth))
    near = depth < 1.5
    assert np.abs(back[near] - depth[near]).max() < error


def test_inverse_depth_is_unpacked_by_the_messages_own_numbers() -> None:
    form, data = encode_compressed_depth(np.full((2, 3), 2.0, np.float32), "16UC1")
    head = struct.pack("<iff", 0, 4000.0, 0.0)  # 2000 in the PNG: depth 4000 / 2000
    assert decode_compressed_depth(form.replace("16UC1", "32FC1"), head + data[12:]) == pytest.approx(2.0)


@pytest.mark.parametrize(
    ("form", "words"),
    [("16UC1; png", "supported"), ("16UC1; compressedDepth rvl", "supported"), ("8UC1; compressedDepth png", "8UC1"),
     ("jpeg", "supported")],
)  # fmt: skip
def test_other_formats_are_refused(form: str, words: str) -> None:
    with pytest.raises(ImageError, match=words):
        decode_compressed_depth(form, encode_compressed_depth(ramp(), "16UC1")[1])


def test_damaged_data_are_refused() -> None:
    form, data = encode_compressed_depth(ramp(), "16UC1")
    for cut in (0, 8, 12, 40):
        with pytest.raises(ImageError):
            decode_compressed_depth(form, data[:cut])
    with pytest.raises(EncodingError):
        encode_compressed_depth(ramp(), "mono8")
