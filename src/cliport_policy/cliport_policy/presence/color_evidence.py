"""Maps of where a scene shows colours of names: basic terms as they are named, others as the nearest thing."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import torch
from torch import Tensor
from torch.nn import functional as F

from cliport_policy.color_words import load_color_head
from cliport_policy.data.color_names import shade_told, terms_told
from cliport_policy.named_colors import color_name_reader
from cliport_policy.networks.joint.color_maps import nearest_shades, unfolded
from cliport_policy.networks.joint.color_words import ColorDensity, naming, scaled_lab

ARM = "open"
TERMS = tuple(terms_told(ARM))


@torch.no_grad()
def term_maps(images: Tensor) -> Tensor:
    """Return where each basic term is the best name for a colour: (B, 12, H/2, W/2) in 0..1, as TERMS are ordered.

    images: (B, 5, H, W), observations.
    """
    x = F.pixel_unshuffle(images, 2).float()
    lab, _, valid = unfolded(x)
    densities, counts = _term_densities()
    near = densities.log_nearness(lab)
    each = naming(near, near) * valid[:, None]  # (B, pieces of words, N)
    maps = torch.stack([pieces.mean(1) for pieces in each.split(counts, dim=1)], dim=1)
    return maps.unflatten(2, x.shape[-2:])


@torch.no_grad()
def shade_maps(shades: Sequence[Sequence[float]], image: Tensor) -> Tensor:
    """Return where one scene (1, 5, H, W) shows what is nearest to each scaled CIELAB colour: (N, H/2, W/2) in 0..1."""
    x = F.pixel_unshuffle(image, 2).float()
    return nearest_shades(x, torch.tensor(shades)[None])[0].unflatten(1, x.shape[-2:])


def surveyed_shade(name: str) -> list[float] | None:
    """Return the scaled CIELAB of a name of the survey, None for a basic term."""
    color = shade_told(name, ARM)
    return None if color is None else [float(value) for value in scaled_lab(torch.tensor(color))]


@lru_cache(maxsize=1)
def _term_densities() -> tuple[ColorDensity, list[int]]:
    """Return the densities (1, N, ...) of the pieces of all basic terms' words, and each term's number of pieces."""
    tokens = [color_name_reader().name_tokens(term) for term in TERMS]
    with torch.no_grad():
        densities = load_color_head(ARM)(torch.cat(tokens)[None].float().clone())
    return densities, [len(each) for each in tokens]
