"""An augmentation moves the picture and its labels alike."""

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cliport_policy.config import TrainConfig
from cliport_policy.data.augmentation import (
    draw_transform,
    identity_transform,
    is_falsified_by_turning,
    jitter_color,
    jitter_height,
    names_direction,
    warp,
)
from cliport_policy.data.batches import Phrasebook, make_sample
from cliport_policy.data.demonstrations import load_demonstrations
from cliport_policy.data.mixture import Drawn


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


def test_all_labels_of_a_sample_turn_with_its_picture(make_flat_set: Callable[..., Path], tmp_path: Path) -> None:
    data = load_demonstrations(make_flat_set(tmp_path / "data", 1))
    demo = replace(data.frames[0].demos[0], pick_yaw=0.7, place_yaw=-0.4)
    drawn, book = Drawn(data, data.frames[0], demo, None), Phrasebook({demo.instruction: 0}, np.random.default_rng(0))
    still = TrainConfig(jitter=False, augment_probability=0.0)
    plain = make_sample(drawn, book, None, still, np.random.default_rng(0))
    assert (plain.pick, plain.place, plain.pick_yaw) == (demo.pick_pixel, demo.place_pixel, 0.7)
    assert plain.rotation == pytest.approx(-1.1) and plain.pick_yaw_period == demo.pick_yaw_period
    for seed in range(8):
        moving = replace(still, augment_probability=1.0)
        sample = make_sample(drawn, book, None, moving, np.random.default_rng(seed))
        for before, after in ((plain.pick, sample.pick), (plain.place, sample.place)):
            there = sample.image[round(after[0]), round(after[1])]
            assert there == pytest.approx(plain.image[round(before[0]), round(before[1])], abs=0.02)
        turned = _direction(sample.pick, sample.place) - _direction(plain.pick, plain.place)
        assert abs(math.remainder(turned, 2 * math.pi)) > 0.02
        assert math.remainder(sample.pick_yaw - 0.7 - turned, 2 * math.pi) == pytest.approx(0, abs=1e-6)
        assert (sample.rotation, sample.pick_yaw_period) == (plain.rotation, plain.pick_yaw_period)


def _direction(a: tuple[float, float], b: tuple[float, float]) -> float:
    """The yaw in which b lies from a: from columns towards rows [rad]."""
    return math.atan2(b[0] - a[0], b[1] - a[1])


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
    ("sentence", "directed", "turns"),
    [
        ("put the red L shape in the Left square hole", True, False),
        ("put the gray star in the middle star hole", True, False),
        ("align the rope from front left tip to back left corner", True, True),
        ("put the red block in the front left corner", True, False),
        ("move the red ring to the middle of the stand", False, True),
        ("put the red block on the middle brown block", False, True),
        ("put the red blocks in a blue bowl", False, True),
        ("pack the leftover righteous topping", False, True),
    ],
)
def test_sentences_that_name_a_direction(sentence: str, directed: bool, turns: bool) -> None:
    assert names_direction(sentence) is directed
    assert is_falsified_by_turning(sentence) is not turns
