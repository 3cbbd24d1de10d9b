"""Things of a kind that a sentence names: picks are led to them, and what lies in its box needs no more packing."""

from __future__ import annotations

import math
from typing import NamedTuple

import torch
from torch import Tensor
from torch.nn import functional as F

from cliport_policy.leading import Leads
from cliport_policy.networks.joint.color_maps import SEEN, unfolded
from cliport_policy.networks.joint.color_words import LAB_SCALE

_LEAST = 0.1  # share from which on something is taken for a thing of the kind,
_MOST_THINGS = 8  # the likeliest ones,
_APART = 0.03  # which lie so far from each other [m]
_REACH = 0.03  # of a thing's picks around where it is seen [m]
HEARD = 0.3  # how far the policy's own odds between things count
_RING = (0.019, 0.056)  # what lies around a thing is looked at from here to there [m]
_LOW, _BARE = 0.006, 0.0015  # nothing stands there, and the table is bare there [m above the table]
_SAME = 15 / LAB_SCALE  # how far, in scaled CIELAB, what is bare looks from the table
_MOSTLY = 0.5  # share of what is around a thing, or of all that is low, from which on it is the table
_FEW = 10  # pixels around a thing that tell nothing
_SURE = 0.98  # no share is believed more than this, nor less than its complement,
_SAID = 0.4  # and so much of the difference of their log odds is heard


class ThingsOfKind(NamedTuple):
    """Things of one kind in a scene.

    leads: those that are still to be picked; None where there is none. placed: log odds to be added to those that
    nothing remains to be done: what is known of things in their place, beside things elsewhere.
    """

    leads: Leads | None
    placed: float


def things_of_kind(image: Tensor, shares: Tensor, pixel_size: float, packed: bool) -> ThingsOfKind:
    """Return the things of a kind, where each cell's share of it is known.

    image: (1, 5, H, W), an observation. shares: (h, w) in 0..1, of cells of any size over the same table. pixel_size:
    of the observation [m]. packed: whether things are packed into something, where they are not to be picked again.
    """
    lab, height, valid = unfolded(F.pixel_unshuffle(image, 2))
    size = image.shape[-2] // 2, image.shape[-1] // 2
    side = 2 * pixel_size
    rows, cols = torch.meshgrid(*(torch.arange(n, dtype=torch.float32) for n in size), indexing="ij")
    seen = valid[0] > SEEN
    low = seen & (height[0] < _LOW)
    bare = _looks_bare(lab[0], seen & (height[0] < _BARE), low) if packed else None
    cells, weights = [], []
    inside = outside = 0.0
    taken = torch.zeros(size, dtype=torch.bool)
    for row, col, share in _peaks(shares, size, _APART / side):
        away = torch.hypot(rows - row, cols - col) * side
        around = ((away > _RING[0]) & (away < _RING[1])).flatten() & low
        if bare is not None and int(around.sum()) >= _FEW and float(bare[around].float().mean()) < _MOSTLY:
            inside = max(inside, share)
            continue
        outside = max(outside, share)
        own = (away <= _REACH) & ~taken
        if own.any():
            taken |= own
            cells.append(own)
            weights.append(_log_odds(share))
    leads = Leads(torch.stack(cells), torch.tensor(weights), HEARD) if cells else None
    return ThingsOfKind(leads, 0.0 if bare is None else _SAID * (_log_odds(inside) - _log_odds(outside)))


def _looks_bare(lab: Tensor, table: Tensor, low: Tensor) -> Tensor | None:
    """Return which pixels (N,) look like the bare table; None on a patterned one, where most of what is low does not.

    lab: (N, 3), scaled CIELAB. table: (N,), what is as low as the table. low: (N,), where nothing stands.
    """
    if not table.any():
        return None
    bare = (lab - lab[table].median(0).values).norm(dim=1) < _SAME
    return bare if float(bare[low].float().mean()) >= _MOSTLY else None


def _peaks(shares: Tensor, size: tuple[int, int], apart: float) -> list[tuple[float, float, float]]:
    """Return the rows and columns of the likeliest cells on a grid of a size, and their shares, the likeliest first.

    apart: their least distance on that grid.
    """
    left, found = shares.clone(), list[tuple[float, float, float]]()
    scale = [n / m for n, m in zip(size, shares.shape, strict=True)]
    rows, cols = (
        (torch.arange(m, dtype=torch.float32) + 0.5) * k - 0.5 for m, k in zip(shares.shape, scale, strict=True)
    )
    while len(found) < _MOST_THINGS and float(left.max()) > _LEAST:
        row, col = divmod(int(left.argmax()), left.shape[1])
        found.append((float(rows[row]), float(cols[col]), float(left[row, col])))
        left[torch.hypot(rows[:, None] - rows[row], cols - cols[col]) < apart] = 0.0
    return found


def _log_odds(share: float) -> float:
    known = min(max(share, 1 - _SURE), _SURE)
    return math.log(known / (1 - known))
