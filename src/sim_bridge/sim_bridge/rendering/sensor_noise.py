"""Imperfections of a depth camera: grain in colour and depth, and depth that is lost at edges and slants."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np
import numpy.typing as npt
from scipy.special import ndtri

from sim_bridge.rendering.clean_frame import CleanFrame

_LEVELS = 1 << 16  # different values of a draw
_NO_DEPTH = np.float32(1e3)  # depth that stands for none [m]
_NEIGHBOURS = cv2.getStructuringElement(cv2.MORPH_CROSS, (3, 3))


@dataclass(frozen=True)
class NoiseConfig:
    """Imperfections of the sensor; all zero (see `none`) gives perfect images.

    color_sigma: of a channel, on the 0..255 scale. depth_sigma: of depth at 1 m, growing with its square [m].
    edge_step: depth is lost beside steps larger than this [m]; edge_loss: with this probability.
    min_facing: depth is lost where the cosine of the angle to the surface's normal is smaller.
    loss: share of pixels without depth anywhere.
    """

    color_sigma: float = 3.0
    depth_sigma: float = 0.0015
    edge_step: float = 0.015
    edge_loss: float = 0.7
    min_facing: float = 0.15
    loss: float = 0.002

    @classmethod
    def none(cls) -> NoiseConfig:
        """Return the settings of a perfect sensor."""
        return cls(0.0, 0.0, np.inf, 0.0, 0.0, 0.0)


def with_noise(
    clean: CleanFrame, noise: NoiseConfig, rng: np.random.Generator
) -> tuple[npt.NDArray[np.uint8], npt.NDArray[np.float32]]:
    """Return noisy colour, and noisy depth [m] with NaN where it is lost. The
    number of draws from rng depends on no pixel."""
    color = clean.color
    if noise.color_sigma > 0.0:
        grain = np.rint(_normal_quantiles() * noise.color_sigma).astype(np.int16)
        color = cv2.add(color, grain.take(_draws(rng, color.shape)), dtype=cv2.CV_8U)  # saturates
    known = np.isfinite(clean.depth)
    depth = np.where(known, clean.depth, _NO_DEPTH)
    lost = ~known | (clean.facing < noise.min_facing)
    if noise.loss > 0.0 or noise.edge_loss > 0.0:
        chance = _draws(rng, depth.shape)
        at_edge = 1.0 - (1.0 - noise.loss) * (1.0 - noise.edge_loss)
        lost |= chance < noise.loss * _LEVELS
        lost |= (chance < at_edge * _LEVELS) & _edges(depth, noise.edge_step)
    if noise.depth_sigma > 0.0:
        jitter = (_normal_quantiles() * np.float32(noise.depth_sigma)).take(_draws(rng, depth.shape))
        jitter *= depth
        jitter *= depth
        depth += jitter
    depth[lost] = np.nan
    return color, depth


def _draws(rng: np.random.Generator, shape: tuple[int, ...]) -> npt.NDArray[np.uint16]:
    """Draw uniformly from 0 to _LEVELS - 1: indices into a table of any distribution, far cheaper than its formula."""
    return rng.integers(0, _LEVELS, shape, dtype=np.uint16)


@lru_cache(maxsize=1)
def _normal_quantiles() -> npt.NDArray[np.float32]:
    """Return quantiles (_LEVELS,) of the standard normal distribution, each in
    the middle of an equal share; within +-4.3."""
    quantiles: npt.NDArray[np.float64] = ndtri((np.arange(_LEVELS) + 0.5) / _LEVELS)
    return quantiles.astype(np.float32)


def _edges(depth: npt.NDArray[np.float32], step: float) -> npt.NDArray[np.bool_]:
    """Return (H, W) the pixels on either side of a depth step."""
    highest, lowest = cv2.dilate(depth, _NEIGHBOURS), cv2.erode(depth, _NEIGHBOURS)
    edges: npt.NDArray[np.bool_] = np.maximum(highest - depth, depth - lowest) > step
    return edges
