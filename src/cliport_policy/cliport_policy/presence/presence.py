"""Look for what a sentence names in a scene, and for what is missing."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import NamedTuple

import torch
from torch import Tensor
from torch.nn import functional as F

from cliport_policy.data.color_names import color_spans
from cliport_policy.language import TextEncoder
from cliport_policy.networks.joint.color_maps import shown_by_maps
from cliport_policy.presence.color_evidence import TERMS, shade_maps, surveyed_shade, term_maps
from cliport_policy.presence.kinds import spoken
from cliport_policy.presence.scene_net import SceneNet, evidence, grayed
from cliport_policy.presence.sentence_net import Role, SentenceNet
from cliport_policy.presence.vocabulary import Vocabulary

_READINGS = 3  # kinds of one role that are asked about, the likeliest ones
_REMEMBERED = 256  # sentences


class Meant(NamedTuple):
    """Reading of what a sentence has picked, or of what it is placed at.

    kinds: numbers of the likeliest kinds that are known. shares: how likely each is; what is left is not known.
    colors: names of its colours, any of which will do, none if there are none.
    """

    kinds: tuple[int, ...]
    shares: tuple[float, ...]
    colors: tuple[str, ...]


class Missing(NamedTuple):
    """The thing that is least likely there, of those that a sentence names.

    probability: how likely it is not to be seen, 0..1. name: what people call it, such as "purple bowl". known: how
    sure it is that all that is named is of known kinds, 0..1.
    """

    probability: float
    name: str
    known: float


class Presence:
    """Two nets and what their numbers mean."""

    def __init__(self, vocabulary: Vocabulary, encoder: TextEncoder, scene: SceneNet, sentence: SentenceNet) -> None:
        self.vocabulary, self._encoder = vocabulary, encoder
        self._scene, self._sentence = scene.eval(), sentence.eval()
        self.meant = lru_cache(_REMEMBERED)(self._meant)

    @torch.inference_mode()
    def missing(self, image: Tensor, instruction: str) -> Missing:
        """Return which of the things that an instruction names is least likely in a scene.

        image: (1, 5, H, W), an observation. What it does not know for a kind it takes for present.
        """
        asked = self.meant(instruction.strip())
        shades = {color: self._shade(color) for role in asked for color in role.colors}
        maps = _maps(shades, image)
        if any(color not in TERMS for color in shades):
            image = _shown_in_gray(image, torch.stack(list(maps.values())))
        features = self._scene.features(grayed(image, torch.tensor([any(shades.values())])))
        there = [(self._present(role, features, [maps[color] for color in role.colors]), role) for role in asked]
        present, role = min(there, key=lambda one: one[0])
        known = min(sum(role.shares) for role in asked)
        return Missing(1.0 - present, spoken(self.vocabulary.kinds[role.kinds[0]], role.colors), known)

    def _shade(self, color: str) -> Sequence[float] | None:
        """Return a colour's scaled CIELAB, None for a basic term that no demonstration names."""
        return self.vocabulary.shade(color) or surveyed_shade(color)

    def _present(self, role: Meant, features: Tensor, maps: list[Tensor]) -> float:
        """Return how likely something is there that a role may mean; maps: where each of its colours is seen."""
        each = max(len(maps), 1)
        rows, cols = (2 * size for size in features.shape[-2:])
        seen = torch.stack(maps) if maps else features.new_zeros(1, rows, cols)
        kinds = torch.tensor(role.kinds)[None].repeat_interleave(each, dim=1)
        any_color = torch.full_like(kinds, not maps, dtype=torch.bool)
        asked = evidence(seen.repeat(len(role.kinds), 1, 1)[None], any_color)
        logits = self._scene.score(features, asked, kinds, torch.zeros_like(kinds))
        best = logits.flatten(2).amax(2).unflatten(1, (-1, each)).amax(2)[0].sigmoid()  # any of its colours will do
        known = torch.tensor(role.shares)
        return float((known * best).sum() + 1 - known.sum())

    @torch.inference_mode()
    def _meant(self, instruction: str) -> tuple[Meant, Meant]:
        """Return what an instruction means to have picked, and where it is to be placed."""
        tokens, mask = self._encoder.encode([instruction])
        kinds, roles = self._sentence(tokens, mask)
        colors: dict[Role, list[str]] = {role: [] for role in Role}
        for begin, end in color_spans(instruction):
            inside = self._encoder.pieces.within(instruction, begin, end)[: roles.shape[1]]
            if inside.any():
                role = Role(int(roles[0, inside].softmax(-1).mean(0).argmax()))
                colors[role].append(_term(instruction[begin:end].lower()))
        pick, place = kinds[0].softmax(-1)
        return self._read(pick, colors[Role.PICK]), self._read(place, colors[Role.PLACE])

    def _read(self, shares: Tensor, colors: list[str]) -> Meant:
        best = shares[:-1].topk(min(_READINGS, len(shares) - 1))
        return Meant(tuple(best.indices.tolist()), tuple(best.values.tolist()), tuple(colors))


def _maps(shades: Mapping[str, Sequence[float] | None], image: Tensor) -> dict[str, Tensor]:
    """Return where a scene shows each colour, (H/2, W/2) in 0..1: by its shade, which tells more, or by its name."""
    known = {color: shade for color, shade in shades.items() if shade is not None}
    maps = dict(zip(known, shade_maps(list(known.values()), image), strict=True)) if known else {}
    if len(maps) < len(shades):
        terms = term_maps(image)[0]
        maps |= {color: terms[TERMS.index(color)] for color in shades if color not in known}
    return maps


def _shown_in_gray(image: Tensor, maps: Tensor) -> Tensor:
    """Return an observation (1, 5, H, W) in grey, as bright as the benchmark's blocks where maps (N, H/2, W/2) are."""
    folded = F.pixel_unshuffle(image, 2)
    return F.pixel_shuffle(shown_by_maps(folded, maps[None], torch.ones(1, dtype=torch.bool)), 2)


def _term(color: str) -> str:
    """Return a colour's name as the basic terms are spelled."""
    return color.replace("grey", "gray")
