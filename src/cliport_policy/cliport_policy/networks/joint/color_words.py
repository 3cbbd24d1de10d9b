"""Colour densities of words: which CIELAB colours a word of a sentence may mean, from its frozen embedding."""

from __future__ import annotations

import math
from typing import NamedTuple

import torch
from torch import Tensor, nn
from torch.nn import functional as F

# D65 white and the sRGB primaries (IEC 61966-2-1).
_TO_XYZ = ((0.4124564, 0.3575761, 0.1804375), (0.2126729, 0.7151522, 0.0721750), (0.0193339, 0.1191920, 0.9503041))
_WHITE = (0.95047, 1.0, 1.08883)
LAB_SCALE = 50.0  # CIELAB units to about unit range
# Square of how much wider a word's colours are taken to be than the survey's: people's blue is no single shade.
BLUR = 5.0
MIN_SIGMA = 0.12  # of a component, in LAB_SCALE: light and shadow are at least this wide


class ColorDensity(NamedTuple):
    """Mixtures of normal densities over scaled CIELAB, one for each of the leading dimensions.

    is_color: (...,) logit that the word names a colour at all.
    log_weight: (..., K). mean, log_sigma: (..., K, 3).
    """

    is_color: Tensor
    log_weight: Tensor
    mean: Tensor
    log_sigma: Tensor

    def log_likelihood(self, lab: Tensor) -> Tensor:
        """Return the log density (...,) of scaled CIELAB colours (..., 3)."""
        offset = (lab[..., None, :] - self.mean) / self.log_sigma.exp()
        each = -0.5 * offset.square().sum(-1) - self.log_sigma.sum(-1) - 1.5 * math.log(2 * math.pi)
        return (each + self.log_weight).logsumexp(-1)

    def membership(self, lab: Tensor) -> Tensor:
        """Return how well each of N colours (B, N, 3) suits each of T words (B, T): (B, T, N) in 0..1.

        1 at a component's own colour, whatever its weight and width; the best component counts.
        """
        return self.log_nearness(lab, BLUR).exp_().clamp_(max=1.0)

    def log_nearness(self, lab: Tensor, blur: float = 1.0) -> Tensor:
        """Return how near each of N colours (B, N, 3) lies to each of T words (B, T), in nats: (B, T, N).

        0 at the heaviest component's own colour, less elsewhere. blur: by how much wider, squared, words are taken.
        """
        precision = (-2 * self.log_sigma).exp()  # (B, T, K, 3)
        constant = (precision * self.mean.square()).sum(-1, keepdim=True) - 2 * self._rarity()[..., None]
        terms = torch.cat((precision, -2 * precision * self.mean, constant), dim=-1)  # (B, T, K, 7)
        powers = torch.cat((lab.square(), lab, torch.ones_like(lab[..., :1])), dim=-1)  # (B, N, 7)
        distance = terms.flatten(1, 2) @ powers.transpose(1, 2)  # (B, T K, N)
        nearest = distance.unflatten(1, self.log_weight.shape[1:]).amin(2)  # (B, T, N)
        return nearest.mul_(-0.5 / blur)

    def _rarity(self) -> Tensor:
        """Return each component's log weight relative to the heaviest, no more than 0: (..., K)."""
        return self.log_weight - self.log_weight.amax(-1, keepdim=True)


def naming(near: Tensor, others: Tensor) -> Tensor:
    """Return how well each of T words names N colours beside M other words: (B, T, N) in 0..1.

    1 where no other word suits the colour better; otherwise by how much it does so less. near: (B, T, N) and others:
    (B, M, N), nats, their log_nearness.
    """
    return (near - others.amax(1, keepdim=True)).clamp_(max=0.0).exp_()


class ColorHead(nn.Module):
    """Small network from a token's frozen embedding to the colours that it may mean."""

    def __init__(self, token_dim: int = 384, hidden: int = 96, components: int = 3) -> None:
        super().__init__()
        self.components = components
        self.hidden = nn.Sequential(nn.LayerNorm(token_dim), nn.Linear(token_dim, hidden), nn.GELU())
        self.out = nn.Linear(hidden, 1 + 7 * components)

    def forward(self, tokens: Tensor) -> ColorDensity:
        """Return the densities of tokens (..., token_dim)."""
        values = self.out(self.hidden(tokens))
        is_color, weight, rest = values.split((1, self.components, 6 * self.components), dim=-1)
        mean, spread = rest.unflatten(-1, (self.components, 6)).chunk(2, dim=-1)
        log_sigma = math.log(MIN_SIGMA) + F.softplus(spread)
        middle = mean + mean.new_tensor((1.2, 0.0, 0.0))
        return ColorDensity(is_color.squeeze(-1), weight.log_softmax(-1), middle, log_sigma)


def scaled_lab(color: Tensor) -> Tensor:
    """Return scaled CIELAB (..., 3) of sRGB 0..1 (..., 3)."""
    color = color.clamp(0, 1)
    linear = torch.where(color <= 0.04045, color / 12.92, ((color.clamp_min(0.04045) + 0.055) / 1.055) ** 2.4)
    xyz = linear @ color.new_tensor(_TO_XYZ).T / color.new_tensor(_WHITE)
    root = torch.where(xyz > 216 / 24389, xyz.clamp_min(1e-6) ** (1 / 3), (24389 / 27 * xyz + 16) / 116)
    x, y, z = root.unbind(-1)
    return torch.stack((116 * y - 16, 500 * (x - y), 200 * (y - z)), dim=-1) / LAB_SCALE
