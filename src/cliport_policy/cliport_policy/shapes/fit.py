"""Training of the network of outlines, on drawings alone."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional as F

from cliport_policy.shapes.drawings import draw
from cliport_policy.shapes.names import SHAPES
from cliport_policy.shapes.outline_net import OutlineNet

_RATE, _DECAY, _WARM_UP = 3e-3, 0.02, 200
_OTHER_SHARE = 0.08  # of the drawings are of no named shape


class Drawings(NamedTuple):
    """Batch: pictures (B, SIDE, SIDE) in 0..1, and the number of each one's shape (B,), len(SHAPES) for another."""

    pictures: Tensor
    numbers: Tensor


class DrawnBatches:
    """Batches by their numbers, the same ones for the same seed."""

    def __init__(self, size: int, seed: int) -> None:
        self.size, self.seed = size, seed

    def batch(self, number: int) -> Drawings:
        """Return a batch."""
        rng = np.random.default_rng((self.seed, number))
        shapes = rng.integers(len(SHAPES), size=self.size)
        shapes[rng.random(self.size) < _OTHER_SHARE] = len(SHAPES)
        pictures = np.stack([draw(int(shape), rng) for shape in shapes])
        return Drawings(torch.from_numpy(pictures), torch.from_numpy(shapes))


def outline_optimizer(net: OutlineNet) -> torch.optim.Optimizer:
    """Return the optimiser of a net of outlines."""
    return torch.optim.AdamW(net.parameters(), lr=_RATE, weight_decay=_DECAY)


def outline_step(net: OutlineNet, optimizer: torch.optim.Optimizer, batch: Drawings, step: int, steps: int) -> float:
    """Take one of some steps, the first one being 0, by a batch; return its loss."""
    rate = _RATE * min(1.0, (step + 1) / _WARM_UP) * (1 - step / steps)
    optimizer.param_groups[0]["lr"] = rate
    loss = F.cross_entropy(net.train()(batch.pictures), batch.numbers)
    optimizer.zero_grad()
    loss.backward()
    optimizer.step()
    return loss.item()


@torch.inference_mode()
def share_right(net: OutlineNet, drawings: Drawings) -> float:
    """Return for which share of drawings a net's likeliest shape is theirs."""
    return float((net.eval()(drawings.pictures).argmax(1) == drawings.numbers).float().mean())
