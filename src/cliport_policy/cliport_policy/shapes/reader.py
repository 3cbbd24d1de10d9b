"""Look for a named shape among the things on the table."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from cliport_policy.leading import Leads
from cliport_policy.observation import unscaled
from cliport_policy.shapes.names import SHAPES
from cliport_policy.shapes.outline_net import OutlineNet
from cliport_policy.shapes.silhouettes import silhouettes

_LEAST = 0.03  # share from which on picks are led to a thing
_HEARD = 0.5  # how far the policy's own odds between things count, of which it knows the colours and not the shape


class Outlined(NamedTuple):
    """Things on the table, and how likely each is what a sentence names.

    cells: (N, rows, cols) bool, where each is on the heightmap. shares: (N,) in 0..1, each by itself.
    """

    cells: Tensor
    shares: Tensor

    def most(self) -> float:
        """Return the largest share, 0 if there is no thing."""
        return float(self.shares.max()) if len(self.shares) else 0.0

    def leads(self) -> Leads | None:
        """Return what picks are led to; None where no thing has that outline."""
        return Leads(self.cells, self.shares.clamp_min(1e-6).log(), _HEARD) if self.most() >= _LEAST else None


class ShapeReader:
    """Network of outlines, for heightmaps of one pixel size."""

    def __init__(self, net: OutlineNet, pixel_size: float) -> None:
        """pixel_size: of the heightmaps [m]."""
        self._net, self._pixel_size = net, pixel_size

    @torch.inference_mode()
    def look(self, image: Tensor, name: str) -> Outlined:
        """Return the things of an observation (1, 5, rows, cols), and how likely each has the shape of a name."""
        height, valid = unscaled(image)[0, 3].numpy(), image[0, 4].numpy() > 0
        things = silhouettes(height, valid, self._pixel_size)
        if not things:
            return Outlined(torch.zeros(0, *height.shape, dtype=torch.bool), torch.zeros(0))
        pictures = torch.from_numpy(np.stack([thing.picture for thing in things]))
        cells = torch.from_numpy(np.stack([thing.cells for thing in things]))
        return Outlined(cells, self._net(pictures).softmax(1)[:, SHAPES.index(name)])
