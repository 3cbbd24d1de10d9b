"""An augmentation moves the picture and its labels alike."""

import math

import numpy as np
import pytest

from cliport_policy.data.augmentation import (
    draw_transform,
    identity_transform,
    jitter_color,
    jitter_height,
    names_direction,
    warp,
)


def test_a_marked_pixel_goes_where_its_label_goes() -> None:
    rng = np.random.default_rng(0)
    for _ in range(20):
        pixel = (int(rng.integers(60, 260)), int(rng.integers(40, 120)))
        image = np.zeros((320, 160, 1), np.float32)
        image[pixel[0] - 1 : pixel[0] + 2, pixel[1] - 1 : pixel[1] + 2] = 1
        transform = draw_transform((320, 160), [pixel], 60, 26.67, rng)
        moved = warp(image, transform).reshape(320, 160)
        row, col = transform.pixel(pixel)
        if not (3 <= row <= 316 and 3 <= col <= 156):
            continue
        found = np.unravel_index(moved.argmax(), moved.shape)
        assert math.hypot(found[0] - row, found[1] - col) <= 1.5


def test_yaw_turns_with_the_picture() -> None:
    rng = np.random.default_rng(1)
    transform = draw_transform((320, 160), [], 60, 0, rng)
    a, b = (160.0, 80.0), (160.0, 90.0)  # ten columns along: yaw 0
    (row_a, col_a), (row_b, col_b) = transform.pixel(a), transform.pixel(b)
    assert math.isclose(
        math.remainder(math.atan2(row_b - row_a, col_b - col_a) - transform.angle, 2 * math.pi),
        0,
        abs_tol=1e-9,
    )


def test_pixels_are_kept_inside() -> None:
    rng = np.random.default_rng(2)
    for _ in range(100):
        transform = draw_transform((320, 160), [(5, 5), (310, 150)], 60, 26.67, rng)
        for pixel in ((5, 5), (310, 150)):
            row, col = transform.pixel(pixel)
            assert -1e-6 <= row <= 319 + 1e-6 and -1e-6 <= col <= 159 + 1e-6


def test_identity_changes_nothing() -> None:
    image = np.random.default_rng(3).random((32, 16, 5), np.float32)
    assert np.allclose(warp(image, identity_transform()), image)


def test_color_jitter_is_small_and_keeps_shape() -> None:
    color = np.full((4, 3, 3), 128, np.uint8)
    jittered = jitter_color(color, np.random.default_rng(4))
    assert jittered.shape == color.shape and jittered.dtype == np.uint8
    assert np.abs(jittered.astype(int) - 128).max() < 60


def test_height_jitter_is_small_and_even() -> None:
    height = np.linspace(0, 0.1, 12, dtype=np.float32).reshape(4, 3)
    change = jitter_height(height, np.random.default_rng(5)) - height
    assert change.dtype == np.float32 and np.ptp(change) < 1e-6 and 0 < abs(change.mean()) < 0.01


@pytest.mark.parametrize(
    ("sentence", "directed"),
    [
        ("put the red L shape in the Left square hole", True),
        ("align the rope from front left tip to back left corner", True),
        ("put the red blocks in a blue bowl", False),
        ("pack the leftover righteous topping", False),
    ],
)
def test_sentences_that_name_a_direction(sentence: str, directed: bool) -> None:
    assert names_direction(sentence) is directed
