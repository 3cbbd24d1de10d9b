"""Heightmaps as the networks see them: five channels, scaled to about unit range."""

from __future__ import annotations

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from cliport_core.heightmap import Heightmap

CHANNELS = 5
_COLOR_MEAN = 127.5
_COLOR_SCALE = 64.0
_HEIGHT_SCALE = 0.04  # m: the height of a block


def stack_channels(
    color: NDArray[np.uint8], height: NDArray[np.float32], valid: NDArray[np.bool_]
) -> NDArray[np.float32]:
    """Return red, green, blue, height and valid as channels (H, W, 5) float32.

    color: (H, W, 3). height: (H, W) m. valid: (H, W). Unseen cells are 0 in every channel, which is also what an
    augmentation fills in beyond the border.
    """
    out = np.empty((*height.shape, CHANNELS), np.float32)
    out[..., :3] = (color.astype(np.float32) - _COLOR_MEAN) / _COLOR_SCALE
    out[..., 3] = height / _HEIGHT_SCALE
    out[..., 4] = 1.0
    out *= valid[..., None]
    return out


def to_tensor(channels: NDArray[np.float32]) -> Tensor:
    """Return channels (H, W, 5) as a tensor (5, H, W)."""
    return torch.from_numpy(np.ascontiguousarray(channels.transpose(2, 0, 1)))


def observation_tensor(observation: Heightmap) -> Tensor:
    """Return one heightmap as a batch of one: (1, 5, rows, cols) float32."""
    return to_tensor(stack_channels(observation.color, observation.height, observation.valid)).unsqueeze(0)


def scaled_color(value: float) -> float:
    """Return a colour's component, 0..255, as observation tensors have it."""
    return (value - _COLOR_MEAN) / _COLOR_SCALE


def unscaled(images: Tensor) -> Tensor:
    """Return colour in 0..1 and height in m of observation tensors: (B, 5, H, W) -> (B, 4, H, W).

    Unseen cells are black and at height 0.
    """
    color = (images[:, :3] * _COLOR_SCALE + _COLOR_MEAN * images[:, 4:]) / 255
    return torch.cat((color, images[:, 3:4] * _HEIGHT_SCALE), dim=1)


def without_heights(images: Tensor) -> Tensor:
    """Return observation tensors with every height 0: (B, 5, H, W) -> (B, 5, H, W)."""
    return torch.cat((images[:, :3], torch.zeros_like(images[:, 3:4]), images[:, 4:]), dim=1)


def without_mask(images: Tensor) -> Tensor:
    """Return observation tensors with every cell marked as seen: (B, 5, H, W) -> (B, 5, H, W).

    Colours stay as they are: grey where nothing was seen.
    """
    return torch.cat((images[:, :4], torch.ones_like(images[:, 4:])), dim=1)
