"""Sweeps that meet something: what stands on the table along the way from a start to an end."""

from __future__ import annotations

import numpy as np
from torch import Tensor

from cliport_policy.observation import unscaled
from cliport_policy.shapes.silhouettes import LEAST_HEIGHT

STARTS = 5  # likely ones at most that are tried,
LEAST_SHARE = 0.01  # and after the first only those that are as likely as this
_NEAR = 0.012  # from the way: half of a closed hand, and 2 mm [m]
_LEAST_AREA = 0.5e-4  # of what is met [m^2]: half of a block of a pile


def meets_something(image: Tensor, start: tuple[int, int], end: tuple[int, int], pixel_size: float) -> bool:
    """Return whether something stands on or near the way of a hand that goes from one pixel (row, col) to another.

    image: (1, 5, rows, cols), an observation tensor. pixel_size: of a pixel [m].
    """
    height = unscaled(image)[0, 3].numpy()
    standing = np.argwhere(height > LEAST_HEIGHT) - np.array(start)
    way = np.subtract(end, start)
    along = np.clip(standing @ way / max(float(way @ way), 1e-9), 0.0, 1.0)
    near = np.linalg.norm(standing - along[:, None] * way, axis=1) < _NEAR / pixel_size
    return bool(near.sum() * pixel_size**2 >= _LEAST_AREA)
