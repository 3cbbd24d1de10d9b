"""Fits of what is picked at the likeliest places: as an aligner sees them, and on prints of its outline."""

from __future__ import annotations

import math
from collections.abc import Sequence

import torch
from torch import Tensor

from cliport_policy.networks.policy_network import Goal, Placings, PolicyNetwork
from cliport_policy.networks.rotation import bin_angles
from cliport_policy.peaks import Peak
from cliport_policy.shapes.prints import Print
from cliport_policy.turns import split_over

_LOOKED_AT_AGAIN = 8  # pairs of a place and a rotation, the likeliest ones at a first look
_BESIDE = tuple((row, col) for row in (-2.0, 0.0, 2.0) for col in (-2.0, 0.0, 2.0))  # pixels: 5 mm around a place
_QUARTER = math.pi / 2
CLEAR = 8.0  # contrast from which on a patch is a print,
_AS_CLEAR = 40.0  # and beyond which more says nothing
_HEARD = 0.5  # how far the transport's own odds between prints count
_OUT = 20.0  # logits that put all else out
_NO_PART = 1e-6  # of a turn, instead of none
_SPREAD = 0.7  # of a place over cells, as a standard deviation [cells]


def seen_fits(
    network: PolicyNetwork,
    image: Tensor,
    goal: Goal,
    pick: Tensor,
    yaw: Tensor,
    candidates: Sequence[Peak],
    places: Tensor,
) -> Tensor:
    """Return logits (n, k) of n candidates under each of k rotations.

    image: (1, C, H, W). pick: (1, 2) float pixel. yaw: (1,) rad. places: (k, h, w), the transport's logits.
    The likeliest pairs are looked at again, also a little beside their places, since pick and place are not exact and
    what fits badly there may fit well 5 mm on; then from four sides in all, each where it fitted best: how well two
    things fit does not hang on the side that they are seen from, but the network's errors do.
    """
    angles = bin_angles(len(places), places.device)
    turns = angles.repeat(len(candidates))  # (n k,)
    pixels = torch.tensor([peak.pixel for peak in candidates], dtype=torch.float32).repeat_interleave(len(angles), 0)

    def look(quarters: int, at: Tensor, turned: Tensor) -> Tensor:
        placings = Placings(pick, yaw + quarters * _QUARTER, at[None], turned[None])
        return network.score_fits(image, goal, placings)[0].float()

    fits = look(0, pixels, turns)
    shares = shares_of(places, candidates).repeat_interleave(len(angles))
    again = (fits + shares).topk(min(_LOOKED_AT_AGAIN, len(fits))).indices
    at = pixels[again, None] + torch.tensor(_BESIDE)  # (m, 9, 2)
    beside = look(1, at.flatten(0, 1), turns[again].repeat_interleave(len(_BESIDE))).unflatten(0, at.shape[:2])
    best, shift = beside.max(1)
    at = at[torch.arange(len(at)), shift]
    looks = torch.stack([best, *(look(quarters, at, turns[again]) for quarters in (0, 2, 3))])
    mean = (looks - looks.mean(1, keepdim=True)).mean(0) + fits[again].mean()
    fits = fits.clamp_max(float(mean.min()))  # what one look alone found counts for no more than any of these
    fits[again] = mean
    return fits.unflatten(0, (len(candidates), len(angles)))


def with_fits(places: Tensor, candidates: Sequence[Peak], fits: Tensor) -> Tensor:
    """Return logits of places (k, h, w) with logits of fits (n, k) at n candidates on top.

    Around each candidate the cells keep their shares among each other, and the rotations get those that their fits say.
    The candidates' shares are dealt out anew by how well they fit; all other cells keep theirs.
    """
    joint = places.clone()
    shares = shares_of(places, candidates)
    dealt = (shares + fits.logsumexp(1)).log_softmax(0) + shares.logsumexp(0)
    for peak, was, becomes, turns in zip(candidates, shares, dealt, fits.log_softmax(1), strict=True):
        near = torch.from_numpy(peak.near)
        joint[:, near] = places[:, near].logsumexp(0) + turns[:, None] + (becomes - was)
    return joint


def share_of_prints(shares: Tensor, prints: Sequence[Print]) -> Tensor | None:
    """Return the logarithms of the shares (n,) of n prints at as many places; None where none is clear.

    The square of their contrasts says which, and the transport's own odds with half their logarithm. shares: (n,), the
    logarithms of what the transport says.
    """
    contrasts = torch.tensor([one.contrast for one in prints])
    if not len(prints) or float(contrasts.max()) < CLEAR:
        return None
    return (_HEARD * shares + 2 * contrasts.clamp(1.0, _AS_CLEAR).log()).log_softmax(0)


def with_prints(places: Tensor, prints: Sequence[Print], shares: Tensor, cell_size: int) -> Tensor:
    """Return logits of places (k, h, w) that lie on prints, turned as these do. shares: (n,), logarithms."""
    joint = places - places.logsumexp((0, 1, 2)) - _OUT
    rows, cols = (torch.arange(size, dtype=torch.float32) for size in places.shape[1:])
    for one, share in zip(prints, shares, strict=True):
        row, col = ((pixel - (cell_size - 1) / 2) / cell_size for pixel in one.pixel)
        near = -((rows[:, None] - row).square() + (cols - col).square()) / (2 * _SPREAD**2)
        there = share + near.flatten().log_softmax(0).view_as(near)
        for rotation, part in split_over(one.turn, len(places)):
            joint[rotation] = torch.logaddexp(joint[rotation], there + math.log(max(part, _NO_PART)))
    return joint


def shares_of(places: Tensor, candidates: Sequence[Peak]) -> Tensor:
    """Return the logarithms (n,) of the candidates' shares of a distribution with logits (k, h, w)."""
    total = places.logsumexp((0, 1, 2))
    return torch.stack([places[:, torch.from_numpy(peak.near)].logsumexp((0, 1)) - total for peak in candidates])
