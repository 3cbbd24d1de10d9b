"""Lead picks to things that are found in other ways than by the policy's own locator."""

from __future__ import annotations

from typing import NamedTuple

from torch import Tensor
from torch.nn import functional as F

_OUT = 20.0  # logits that put all else out


class Leads(NamedTuple):
    """Things that picks are led to.

    cells: (N, rows, cols) bool, where each is. weights: (N,) how much speaks for each, as log odds or as the logarithm
    of a share. heard: how far the policy's own odds between things count; within each they count whole.
    """

    cells: Tensor
    weights: Tensor
    heard: float


def led_picks(picks: Tensor, leads: Leads | None) -> Tensor:
    """Return logits of picks (h, w), led to things that are meant, in sum as likely as before.

    Where there are none the logits stay as they are.
    """
    if leads is None:
        return picks
    size = leads.cells.shape[-1] // picks.shape[-1]
    near = F.max_pool2d(leads.cells.float(), size) > 0 if size > 1 else leads.cells
    led = picks - _OUT
    for cells, weight in zip(near, leads.weights, strict=True):
        inside = picks[cells]
        led[cells] = inside + weight - (1 - leads.heard) * inside.logsumexp(0)
    return led + picks.flatten().logsumexp(0) - led.flatten().logsumexp(0)
