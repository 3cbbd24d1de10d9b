"""Kinds that are kin to a name which no demonstration holds: what is called a duck looks like a rubber duck."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.nn import functional as F

from cliport_policy.language import TextEncoder
from cliport_policy.leading import Leads
from cliport_policy.observation import unscaled
from cliport_policy.presence.kinds import is_everyday
from cliport_policy.presence.things_of_kind import HEARD
from cliport_policy.shapes.silhouettes import standing

_SENTENCE = "pack the {} in the brown box"
_SOFT = 3.0  # temperature of the kinds that a thing looks like
_SAYS = 6.0  # logits by which what suits a name wholly is ahead of what has nothing to do with it
_MOST = 0.35  # across what stands out from the table, the box too [m]


class Kin:
    """Everyday kinds of a vocabulary, and how near a sentence comes to each by what its words mean.

    A thing that nobody named looks like a mixture of known kinds (Norouzi et al., ConSE, 2014): the mixture of their
    names is compared with the name that is asked for.
    """

    def __init__(self, kinds: Sequence[str], encoder: TextEncoder) -> None:
        """kinds: those of a vocabulary, in its order."""
        self._encoder = encoder
        self._numbers = [number for number, kind in enumerate(kinds) if is_everyday(kind)]
        self._names = [kinds[number] for number in self._numbers]

    @cached_property
    def _known(self) -> tuple[Tensor, Tensor]:
        """Mean (384,) of the kinds' sentences, and each one's direction from it (n, 384)."""
        vectors = self._encoder.encode([_SENTENCE.format(name) for name in self._names]).sentence_vectors()
        mean = vectors.mean(0)
        return mean, F.normalize(vectors - mean, dim=1)

    def leads(self, instruction: str, things: Tensor, kinds: Tensor) -> Leads | None:
        """Return how far each thing suits a sentence; None where there is none.

        things: (N, H, W) bool. kinds: (K, h, w), logits of the vocabulary's kinds. A thing counts by how much better it
        suits the sentence than it suits the known names on average: what looks like all kinds suits no name.
        """
        if not len(things) or not self._numbers:
            return None
        mean, known = self._known
        inside = F.max_pool2d(things.float(), things.shape[-1] // kinds.shape[-1]) > 0
        at = torch.stack([kinds[self._numbers][:, cells].amax(1) for cells in inside])  # (N, n)
        looks = F.normalize((at / _SOFT).softmax(1) @ known, dim=1)
        name = F.normalize(self._encoder.encode_one(instruction).sentence_vectors()[0] - mean, dim=0)
        return Leads(things, _SAYS * (looks @ name - (looks @ known.T).mean(1)), HEARD)


def unpacked(image: Tensor, box: Tensor, pixel_size: float) -> Tensor:
    """Return where the things are that stand on the table beside a box: (N, H, W) bool.

    image: (1, 5, H, W), an observation. box: (h, w), how likely each cell holds the box. pixel_size: of the image [m].
    """
    height, valid = unscaled(image)[0, 3].numpy(), image[0, 4].numpy() > 0
    row, col = divmod(int(box.argmax()), box.shape[1])
    there = np.array([row, col]) * (height.shape[1] // box.shape[1])
    found = [(cells, np.argwhere(cells)) for cells in standing(height, valid, pixel_size, _MOST)]
    walls = [at for _, at in found if _is_within(there, at)]
    free = [cells for cells, at in found if not any(_is_within(at.mean(0), wall) for wall in walls)]
    return torch.from_numpy(np.array(free, np.bool_).reshape(-1, *height.shape))


def _is_within(pixel: NDArray[Any], pixels: NDArray[np.int64]) -> bool:
    """Return True if a pixel (2,) lies in the rectangle around pixels (M, 2)."""
    return bool((pixels.min(0) <= pixel).all() and (pixel <= pixels.max(0)).all())
