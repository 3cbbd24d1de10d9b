from __future__ import annotations

import numpy as np
import pytest

from cliport_perception.temporal_filter import TemporalFilter


def noisy(rng: np.random.Generator, depth: np.ndarray, sigma: float = 0.002) -> np.ndarray:
    return (depth + rng.normal(0.0, sigma, depth.shape)).astype(np.float32)


def test_grain_goes_down_with_the_root_of_the_frames() -> None:
    rng, truth = np.random.default_rng(0), np.full((80, 100), 1.0)
    filtered = TemporalFilter(4)
    for _ in range(4):
        last = filtered.add(noisy(rng, truth))
    assert (last - truth).std() == pytest.approx(0.001, rel=0.1)


def test_what_moved_leaves_no_ghost_and_what_is_unseen_stays_so() -> None:
    rng, truth = np.random.default_rng(0), np.full((80, 100), 1.0)
    filtered = TemporalFilter(5)
    for _ in range(5):
        filtered.add(noisy(rng, truth))
    truth[20:40, 20:40] = 0.9
    truth[50, 50] = np.nan
    last = filtered.add(noisy(rng, truth))
    assert np.abs(last[20:40, 20:40] - 0.9).max() < 0.01
    assert np.isnan(last[50, 50]) and np.isnan(last).sum() == 1
    truth[50, 50] = 1.0
    assert np.isfinite(filtered.add(noisy(rng, truth))).all()


def test_one_frame_is_handed_on_as_it_is() -> None:
    depth = np.ones((4, 5), np.float32)
    assert TemporalFilter(1).add(depth) is depth
    filtered = TemporalFilter(3)
    filtered.add(depth)
    assert filtered.add(np.ones((2, 2), np.float32)).shape == (2, 2)


def test_the_average_is_over_as_many_frames_as_asked() -> None:
    filtered = TemporalFilter(2)
    for value in (1.000, 1.002, 1.004):
        last = filtered.add(np.full((2, 2), value, np.float32))
    assert last == pytest.approx(1.003)
