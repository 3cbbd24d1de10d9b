"""How well what is picked would fit at the likeliest places, as an aligner sees it."""

from __future__ import annotations

import math
from collections.abc import Sequence

import torch
from torch import Tensor

from cliport_policy.networks.policy_network import Goal, Placings, PolicyNetwork
from cliport_policy.networks.rotation import bin_angles
from cliport_policy.peaks import Peak

_LOOKED_AT_AGAIN = 12  # pairs of a place and a rotation, the likeliest ones
_QUARTER_TURNS = (math.pi / 2, math.pi, 3 * math.pi / 2)  # from which sides, after the first look


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
    The likeliest pairs are looked at again from three other sides, and what four looks say is averaged: how well two
    things fit does not hang on the side that they are seen from, but the network's errors do.
    """
    angles = bin_angles(len(places), places.device)
    turns = angles.repeat(len(candidates))  # (n k,)
    pixels = torch.tensor([peak.pixel for peak in candidates], dtype=torch.float32).repeat_interleave(len(angles), 0)

    def look(side: float, chosen: Tensor) -> Tensor:
        placings = Placings(pick, yaw + side, pixels[chosen][None], turns[chosen][None])
        return network.score_fits(image, goal, placings)[0].float()

    fits = look(0.0, torch.arange(len(turns)))
    joint = fits + shares_of(places, candidates).repeat_interleave(len(angles))
    again = joint.topk(min(_LOOKED_AT_AGAIN, len(joint))).indices
    first = fits[again]
    looks = [first - first.mean()]
    for side in _QUARTER_TURNS:
        seen = look(side, again)
        looks.append(seen - seen.mean())
    fits[again] = first.mean() + torch.stack(looks).mean(0)
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


def shares_of(places: Tensor, candidates: Sequence[Peak]) -> Tensor:
    """Return the logarithms (n,) of the candidates' shares of a distribution with logits (k, h, w)."""
    total = places.logsumexp((0, 1, 2))
    return torch.stack([places[:, torch.from_numpy(peak.near)].logsumexp((0, 1)) - total for peak in candidates])
