"""The noise of depth, measured on the table while the camera runs, and what thresholds become with it."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np

from cliport_core.pose import FloatArray

# Thresholds hold as they are up to this standard deviation of depth, and grow in proportion beyond it [m]. It is what
# the simulator's plain camera, for which they were chosen, measures at most: 1.5 mm, 2 mm with flat things around.
REFERENCE_SIGMA = 0.002
_BELOW = 0.03  # what is farther below the table is no noise [m]
_QUARTILE = 0.6745  # median of the absolute value of a standard normal
_LEAST_POINTS = 50


def depth_sigma(heights: FloatArray, drops: FloatArray) -> float | None:
    """Return the standard deviation of depth [m] on the table, or None when too little of it is seen.

    It is taken from the points below the table alone: nothing lies there but noise, whatever stands upon it.

    Args:
        heights: of points over the table's plane (N,) [m].
        drops: by how much each point's ray falls for each metre of depth (N,).
    """
    below = (heights < 0.0) & (heights > -_BELOW) & (drops > 0.0)
    if np.count_nonzero(below) < _LEAST_POINTS:
        return None
    return float(np.median(-heights[below] / drops[below])) / _QUARTILE


@dataclass(frozen=True)
class DepthNoise:
    """Standard deviation of depth [m] over the last frames; None before it was measured."""

    sigma: float | None = None

    @property
    def growth(self) -> float:
        """Factor, 1 or more, by which thresholds that were chosen for little noise are to grow."""
        return 1.0 if self.sigma is None else max(1.0, self.sigma / REFERENCE_SIGMA)


class DepthNoiseMeter:
    """Smoothing of what single frames say: the median of the last ones, so that one odd frame changes little."""

    def __init__(self, frames: int = 15) -> None:
        self._sigmas: deque[float] = deque(maxlen=frames)

    def add(self, sigma: float | None) -> None:
        """Note a frame's standard deviation [m]; None: it had none."""
        if sigma is not None:
            self._sigmas.append(sigma)

    @property
    def noise(self) -> DepthNoise:
        """The present noise."""
        return DepthNoise(float(np.median(self._sigmas)) if self._sigmas else None)
