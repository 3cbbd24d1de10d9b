"""Imperfections of a depth camera: grain in colour and depth, and depth that is lost at edges and slants."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from functools import lru_cache

import cv2
import numpy as np
import numpy.typing as npt
from scipy.special import ndtri

from sim_bridge.rendering.clean_frame import CleanFrame

_LEVELS = 1 << 16  # different values of a draw
_NO_DEPTH = np.float32(1e3)  # depth that stands for none [m]
_NEIGHBOURS = cv2.getStructuringElement(cv2.MORPH_CROSS, (3, 3))


class SensorKind(Enum):
    """Kinds of depth cameras; the plain one is unbiased and has grain only, the perfect one not even that."""

    PERFECT = "perfect"
    PLAIN = "plain"
    STRUCTURED_LIGHT = "structured_light"
    TIME_OF_FLIGHT = "time_of_flight"
    STEREO = "stereo"


@dataclass(frozen=True)
class NoiseConfig:
    """Imperfections of the sensor; all zero (see `none`) gives perfect images.

    color_sigma: of a channel, on the 0..255 scale. depth_sigma: of depth at 1 m, growing with its square [m].
    edge_step: depth is lost beside steps larger than this [m]; edge_loss: with this probability.
    min_facing: depth is lost where the cosine of the angle to the surface's normal is smaller.
    loss: share of pixels without depth anywhere. bias: by which all depth is too large at 1 m, growing with its square
    [m]. step: between the depths that the sensor can tell apart at 1 m, growing with their square [m]. flying: share of
    pixels beside steps whose depth lies between both surfaces. dark_level: of 255, below which a surface is dark;
    dark_loss: share of its pixels without depth. tick: between depths that the sensor can tell apart at any distance
    [m]. gloss_loss: share of a glossy surface's pixels without depth where it throws the sensor's own light straight
    back, or away: where the cosine of the angle to its normal is over gloss_facing, or under gloss_grazing. Painted
    things are glossy, whose channels differ by gloss_color of 255 or more; table, floor and arm are not.
    """

    color_sigma: float = 3.0
    depth_sigma: float = 0.0015
    edge_step: float = 0.015
    edge_loss: float = 0.7
    min_facing: float = 0.15
    loss: float = 0.002
    bias: float = 0.0
    step: float = 0.0
    flying: float = 0.0
    dark_level: float = 0.0
    dark_loss: float = 0.0
    tick: float = 0.0
    gloss_loss: float = 0.0
    gloss_facing: float = 0.97
    gloss_grazing: float = 0.35
    gloss_color: float = 60.0

    @classmethod
    def none(cls) -> NoiseConfig:
        """Return the settings of a perfect sensor."""
        return cls(0.0, 0.0, np.inf, 0.0, 0.0, 0.0)

    @classmethod
    def of_kind(cls, kind: SensorKind) -> NoiseConfig:
        """Return settings of the size that sensors of a kind have; no camera was measured for them."""
        if kind is SensorKind.PERFECT:
            return cls.none()
        if kind is SensorKind.STRUCTURED_LIGHT:
            return cls(
                depth_sigma=0.0015,
                edge_loss=0.9,
                min_facing=0.25,
                bias=0.002,
                step=0.0028,
                dark_level=35.0,
                dark_loss=0.6,
                gloss_loss=0.6,
            )
        if kind is SensorKind.TIME_OF_FLIGHT:
            return cls(
                depth_sigma=0.0012,
                edge_loss=0.4,
                bias=0.003,
                flying=0.5,
                dark_level=30.0,
                dark_loss=0.5,
                tick=0.001,
                gloss_loss=0.5,
            )
        if kind is SensorKind.STEREO:
            return cls(
                depth_sigma=0.0025, edge_loss=0.8, min_facing=0.2, loss=0.01, bias=0.002, step=0.0015, gloss_loss=0.3
            )
        return cls()


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
    depth = _of_its_kind(depth, clean, noise, lost, rng)
    depth[lost] = np.nan
    return color, depth


def _of_its_kind(
    depth: npt.NDArray[np.float32],
    clean: CleanFrame,
    noise: NoiseConfig,
    lost: npt.NDArray[np.bool_],
    rng: np.random.Generator,
) -> npt.NDArray[np.float32]:
    """Return depth with what sensors of a kind do to it, and mark in `lost` what they do not see."""
    if noise.flying > 0.0:
        between = _draws(rng, depth.shape).astype(np.float32) / np.float32(_LEVELS)
        at_edge = _edges(depth, noise.edge_step) & (between < noise.flying) & (depth < _NO_DEPTH / 2)
        low, high = cv2.erode(depth, _NEIGHBOURS), cv2.dilate(depth, _NEIGHBOURS)
        at_edge &= high < _NO_DEPTH / 2
        depth[at_edge] = (low + (high - low) * (between / np.float32(noise.flying)))[at_edge]
        lost &= ~at_edge
    if noise.dark_loss > 0.0:
        dark = clean.color.max(axis=-1) < noise.dark_level
        lost |= dark & (_draws(rng, depth.shape) < noise.dark_loss * _LEVELS)
    if noise.gloss_loss > 0.0:
        lost |= _glossy(clean, noise) & (_draws(rng, depth.shape) < noise.gloss_loss * _LEVELS)
    if noise.bias > 0.0:
        depth = depth + np.float32(noise.bias) * depth * depth
    if noise.step > 0.0:
        disparity = np.maximum(np.rint(1.0 / (np.float32(noise.step) * depth)), 1.0)  # in whole numbers
        depth = (1.0 / (np.float32(noise.step) * disparity)).astype(np.float32)
    if noise.tick > 0.0:
        depth = np.rint(depth / np.float32(noise.tick)) * np.float32(noise.tick)
    return depth


def _glossy(clean: CleanFrame, noise: NoiseConfig) -> npt.NDArray[np.bool_]:
    """Return (H, W) the pixels of glossy surfaces that throw the sensor's light straight back, or away."""
    painted = np.ptp(clean.color, axis=-1) >= noise.gloss_color
    turned = (clean.facing > noise.gloss_facing) | (clean.facing < noise.gloss_grazing)
    return np.asarray(painted & turned)


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
