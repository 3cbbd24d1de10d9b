"""Maps of where a scene shows colours of names: basic terms as they are named, others as the nearest thing."""

from __future__ import annotations

from functools import lru_cache

import torch
from torch import Tensor
from torch.nn import functional as F

from cliport_policy.color_words import load_color_head
from cliport_policy.data.color_names import shade_told, terms_told
from cliport_policy.named_colors import color_name_reader
from cliport_policy.networks.joint.color_maps import nearest_shades, unfolded
from cliport_policy.networks.joint.color_words import ColorDensity, scaled_lab

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
    each = densities.naming(lab, densities) * valid[:, None]  # (B, pieces of words, N)
    maps = torch.stack([pieces.mean(1) for pieces in each.split(counts, dim=1)], dim=1)
    return maps.unflatten(2, x.shape[-2:])


@torch.no_grad()
def name_map(name: str, images: Tensor, terms: Tensor) -> Tensor:
    """Return where the first scene shows the colour of a name of the survey: (H/2, W/2) in 0..1.

    images: (1, 5, H, W). terms: (1, 12, H/2, W/2), of `term_maps`.
    """
    color = shade_told(name, ARM)
    if color is None:
        return terms[0, TERMS.index(name)]
    x = F.pixel_unshuffle(images, 2).float()
    known = scaled_lab(torch.tensor(color))[None, None]
    return nearest_shades(x, known)[0, 0].unflatten(0, x.shape[-2:])


@lru_cache(maxsize=1)
def _term_densities() -> tuple[ColorDensity, list[int]]:
    """Return the densities (1, N, ...) of the pieces of all basic terms' words, and each term's number of pieces."""
    tokens = [color_name_reader().name_tokens(term) for term in TERMS]
    with torch.no_grad():
        densities = load_color_head(ARM)(torch.cat(tokens)[None].float().clone())
    return densities, [len(each) for each in tokens]
