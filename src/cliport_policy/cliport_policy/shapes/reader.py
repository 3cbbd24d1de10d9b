"""Look for a named shape among the things on the table, and lead picks to it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional as F

from cliport_policy.observation import unscaled
from cliport_policy.shapes.names import SHAPES
from cliport_policy.shapes.outline_net import OutlineNet
from cliport_policy.shapes.silhouettes import silhouettes

_LEAST = 0.03  # share from which on picks are led to a thing
_HEARD = 0.5  # how far the policy's own odds between things count, of which it knows the colours and not the shape
_OUT = 20.0  # logits that put all else out


class Outlined(NamedTuple):
    """Things on the table, and how likely each is what a sentence names.

    cells: (N, rows, cols) bool, where each is on the heightmap. shares: (N,) in 0..1, each by itself.
    """

    cells: Tensor
    shares: Tensor

    def most(self) -> float:
        """Return the largest share, 0 if there is no thing."""
        return float(self.shares.max()) if len(self.shares) else 0.0


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


def led_picks(picks: Tensor, outlined: Outlined | None) -> Tensor:
    """Return logits of picks (h, w), led to things that have the outline which is meant, in sum as likely as before.

    Between two such things the policy's own odds count for half their logarithm, within each as they are. Where no
    thing has that outline, the logits stay as they are.
    """
    if outlined is None or outlined.most() < _LEAST:
        return picks
    size = outlined.cells.shape[-1] // picks.shape[-1]
    near = F.max_pool2d(outlined.cells.float(), size) > 0 if size > 1 else outlined.cells
    led = picks - _OUT
    for cells, share in zip(near, outlined.shares, strict=True):
        inside = picks[cells]
        led[cells] = inside + share.clamp_min(1e-6).log() - (1 - _HEARD) * inside.logsumexp(0)
    return led + picks.flatten().logsumexp(0) - led.flatten().logsumexp(0)
