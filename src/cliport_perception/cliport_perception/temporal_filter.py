"""Depth averaged over the last frames, pixel by pixel: less grain, no ghosts, and nothing invented."""

from __future__ import annotations

import math
from collections import deque

import numpy as np
import numpy.typing as npt

from cliport_perception.depth_noise import DepthNoise

FloatImage = npt.NDArray[np.float32]


class TemporalFilter:
    """Averages each pixel over the frames in which it shows what the newest one shows.

    frames: how many are kept. max_step: depths that differ from the newest by less are of the same surface [m]. A pixel
    that the newest frame does not see stays unseen.
    """

    def __init__(self, frames: int, max_step: float = 0.01) -> None:
        self._frames: deque[FloatImage] = deque(maxlen=max(1, frames))
        self._quiet_step, self._max_step = max_step, np.float32(max_step)

    def adapt(self, noise: DepthNoise) -> None:
        """Let frames of one surface differ as much as the noise makes them that is left after this filter."""
        if noise.sigma is not None:
            before = DepthNoise(noise.sigma * math.sqrt(max(1, len(self._frames))))
            self._max_step = np.float32(self._quiet_step * before.growth)

    def add(self, depth_m: FloatImage) -> FloatImage:
        """Return the filtered depth (H, W) [m] of a new frame, NaN where it sees nothing."""
        if self._frames and self._frames[-1].shape != depth_m.shape:
            self._frames.clear()
        earlier = list(self._frames)
        self._frames.append(depth_m)
        if self._frames.maxlen == 1 or not earlier:
            return depth_m
        total, count = depth_m.copy(), np.ones(depth_m.shape, dtype=np.float32)
        for frame in earlier[-(self._frames.maxlen or 1) + 1 :]:
            same = np.abs(frame - depth_m) < self._max_step  # False where either is NaN
            np.add(total, frame, out=total, where=same)
            count += same
        result: FloatImage = total / count
        return result

    def clear(self) -> None:
        """Forget all frames."""
        self._frames.clear()
