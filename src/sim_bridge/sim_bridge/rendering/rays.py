"""Rays that leave a camera, and sums over many vectors.

The sums start no threads, as a matrix product may: one process renders on each core, and each would wait for the
others' threads.
"""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np
import numpy.typing as npt


class Rays(NamedTuple):
    """K rays from one origin (3,) [m], base frame: directions (K, 3), along
    which depth grows by 1 m; their lengths (K,)."""

    origin: npt.NDArray[np.float32]
    directions: npt.NDArray[np.float32]
    lengths: npt.NDArray[np.float32]

    def take(self, rows: npt.NDArray[np.intp]) -> Rays:
        """Take those of some rows (M,)."""
        return Rays(self.origin, self.directions.take(rows, axis=0), self.lengths.take(rows))

    def points(self, depth: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
        """Return the points (K, 3) [m], base frame, at depths (K,) [m] along the rays."""
        return self.origin + self.directions * depth[:, None]

    def facing(self, normals: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
        """Return the cosine (K,) between rays and normals (K, 3), without sign."""
        cosine = np.abs(dot(self.directions, normals))
        cosine /= self.lengths
        return cosine


def dot(a: npt.NDArray[np.float32], b: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
    """Return the products (K,) of vectors (K, 3) with vectors (K, 3) or with one (3,)."""
    return a[:, 0] * b[..., 0] + a[:, 1] * b[..., 1] + a[:, 2] * b[..., 2]


def turned(vectors: npt.NDArray[np.float32], rotation: npt.NDArray[np.floating]) -> npt.NDArray[np.float32]:
    """Apply a rotation (3, 3) to vectors (K, 3)."""
    if not len(vectors):
        return vectors
    result: npt.NDArray[np.float32] = cv2.transform(vectors[None], rotation.astype(np.float32))[0]
    return result
