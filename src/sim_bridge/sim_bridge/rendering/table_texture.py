"""Patterns on the table's top."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum
from functools import lru_cache

import numpy as np
import numpy.typing as npt

_LATTICE = 64  # cells after which the noise repeats


class Pattern(Enum):
    """Layout of a texture's two colours."""

    STRIPES = "stripes"
    CHECKS = "checks"
    GRAIN = "grain"  # like wood
    SPECKLE = "speckle"  # like stone


@dataclass(frozen=True)
class TableTexture:
    """Two colours in a pattern, the same at every look.

    rgb: the colour that is mixed into the table's own, 0..255. period: of the pattern, or size of its speckles [m].
    angle: by which the pattern is turned about z [rad]. seed: of the noise in grain and speckle.
    """

    pattern: Pattern
    rgb: tuple[float, float, float]
    period: float
    angle: float = 0.0
    seed: int = 0

    def colors(self, points: npt.NDArray[np.float32], own: tuple[float, float, float]) -> npt.NDArray[np.float32]:
        """Return colours (K, 3) 0..255 at points (K, 3) [m, base frame] of a table whose own colour is `own`."""
        c, s = math.cos(self.angle), math.sin(self.angle)
        along = (c * points[:, 0] + s * points[:, 1]) / self.period
        across = (c * points[:, 1] - s * points[:, 0]) / self.period
        share = self._share(along, across)[:, None]
        base, other = np.array(own, dtype=np.float32), np.array(self.rgb, dtype=np.float32)
        return np.asarray(base + share * (other - base), dtype=np.float32)

    def _share(self, along: npt.NDArray[np.floating], across: npt.NDArray[np.floating]) -> npt.NDArray[np.float32]:
        """Return the share (K,) of the other colour, 0..1, at places in periods."""
        if self.pattern is Pattern.STRIPES:
            share = np.floor(2.0 * along) % 2.0
        elif self.pattern is Pattern.CHECKS:
            share = (np.floor(along) + np.floor(across)) % 2.0
        elif self.pattern is Pattern.GRAIN:
            bent = along + 1.5 * self._noise(0.3 * along, 0.05 * across)
            share = 0.5 + 0.5 * np.sin(2.0 * np.pi * bent)
        else:
            share = self._noise(along, across)
        return np.asarray(share, dtype=np.float32)

    def _noise(self, u: npt.NDArray[np.floating], v: npt.NDArray[np.floating]) -> npt.NDArray[np.float32]:
        """Return smooth noise (K,) in 0..1 with cells of 1 x 1."""
        lattice = _lattice(self.seed)
        left, low = np.floor(u), np.floor(v)
        right_share, high_share = u - left, v - low
        i, j = left.astype(np.intp) % _LATTICE, low.astype(np.intp) % _LATTICE
        next_i, next_j = (i + 1) % _LATTICE, (j + 1) % _LATTICE
        near = lattice[i, j] + right_share * (lattice[next_i, j] - lattice[i, j])
        far = lattice[i, next_j] + right_share * (lattice[next_i, next_j] - lattice[i, next_j])
        return np.asarray(near + high_share * (far - near), dtype=np.float32)


@lru_cache(maxsize=8)
def _lattice(seed: int) -> npt.NDArray[np.float32]:
    """Return random numbers (_LATTICE, _LATTICE) in 0..1."""
    return np.random.default_rng(seed).random((_LATTICE, _LATTICE), dtype=np.float32)
