"""Look for what a sentence names in a scene, and for what is missing."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import NamedTuple

import torch
from torch import Tensor
from torch.nn import functional as F

from cliport_policy.data.color_names import color_spans
from cliport_policy.language import TextEncoder
from cliport_policy.leading import Leads
from cliport_policy.networks.joint.color_maps import shown_by_maps
from cliport_policy.odds import shifted
from cliport_policy.presence.color_evidence import TERMS, shade_maps, surveyed_shade, term_maps
from cliport_policy.presence.kin import Kin, unpacked
from cliport_policy.presence.kinds import is_called, is_container, is_everyday, is_single, spoken
from cliport_policy.presence.scene_net import SceneNet, evidence, grayed
from cliport_policy.presence.sentence_net import Role, SentenceNet
from cliport_policy.presence.things_of_kind import ThingsOfKind, things_of_kind
from cliport_policy.presence.vocabulary import Vocabulary
from cliport_policy.shapes.names import SHAPES, shape_to_pick
from cliport_policy.shapes.reader import Outlined, ShapeReader

_READINGS = 3  # kinds of one role that are asked about, the likeliest ones
_REMEMBERED = 256  # sentences
KNOWN = 0.9  # share of known kinds beyond which a name is taken to be known
_LIKELY = 0.5  # share from which on the likeliest kind is meant rather than any other
_OUTLINE_BIAS = math.log(10)  # of the log odds of an outline's share: from 1 in 30 on the thing may be there


class Meant(NamedTuple):
    """Reading of what a sentence has picked, or of what it is placed at.

    kinds: numbers of the likeliest kinds that are known. shares: how likely each is; what is left is not known.
    colors: names of its colours, any of which will do, none if there are none. shape: one of SHAPES, "" if it is none.
    """

    kinds: tuple[int, ...]
    shares: tuple[float, ...]
    colors: tuple[str, ...]
    shape: str = ""


class Missing(NamedTuple):
    """A thing that a sentence names, the one that is least likely there.

    probability: how likely it is not to be seen, 0..1. name: what people call it, such as "purple bowl". known: how
    sure it is that all that is named is of known kinds, 0..1. is_outline: True where it was looked for by its outline.
    """

    probability: float
    name: str
    known: float
    is_outline: bool = False


class Look(NamedTuple):
    """Result of a look at a scene for what a sentence names.

    leads: things that may be picked, by their outlines or by their kind; None where neither says which.
    placed: log odds to be added to those that nothing remains to be done.
    """

    missing: Missing
    leads: Leads | None
    placed: float = 0.0


class Presence:
    """Two nets and what their numbers mean, and a reader of outlines for shapes that no demonstration holds."""

    def __init__(
        self,
        vocabulary: Vocabulary,
        encoder: TextEncoder,
        scene: SceneNet,
        sentence: SentenceNet,
        shapes: ShapeReader | None = None,
        pixel_size: float | None = None,
    ) -> None:
        """pixel_size: of observations in which picks are led to things of a named kind [m]; None where they are not."""
        self.vocabulary, self._encoder, self._shapes, self._pixel_size = vocabulary, encoder, shapes, pixel_size
        self._scene, self._sentence = scene.eval(), sentence.eval()
        self._kin = Kin(vocabulary.kinds, encoder)
        self.meant = lru_cache(_REMEMBERED)(self._meant)

    @torch.inference_mode()
    def look(self, image: Tensor, instruction: str) -> Look:
        """Return which of the things that an instruction names is least likely in a scene, and what may be picked.

        image: (1, 5, H, W), an observation. What it does not know for a kind it takes for present.
        """
        asked = pick, _ = self.meant(instruction.strip())
        shades = {color: self._shade(color) for role in asked for color in role.colors}
        maps = _maps(shades, image)
        outlined = self._outlined(image, pick, maps)
        is_surveyed = any(color not in TERMS for color in shades)
        shown = _shown_in_gray(image, torch.stack(list(maps.values()))) if is_surveyed else image
        features = self._scene.features(grayed(shown, torch.tensor([any(shades.values())])))
        seen = [self._seen(role, features, [maps[color] for color in role.colors]) for role in asked]
        there = [self._by_kind(role, cells) for role, cells in zip(asked, seen, strict=True)]
        if outlined is not None:
            there[0] = self._by_outline(pick, outlined, there[0])
            found = ThingsOfKind(outlined.leads(), 0.0)
        else:
            found = self._things(image, instruction, *zip(asked, seen, strict=True))
        least = max(there, key=lambda thing: thing.probability)
        return Look(least._replace(known=min(thing.known for thing in there)), found.leads, found.placed)

    def _things(
        self, image: Tensor, instruction: str, picked: tuple[Meant, Tensor], placed: tuple[Meant, Tensor]
    ) -> ThingsOfKind:
        """Return what may be picked: of the kind that is named, or kin to a name that is not known.

        picked, placed: what is meant, and how likely each cell holds its kinds (K, h, w).
        """
        (pick, pick_seen), (place, place_seen) = picked, placed
        if self._pixel_size is None:
            return ThingsOfKind(None, 0.0)
        packed = is_container(self.vocabulary.kinds[place.kinds[0]])
        if self._is_by_kind(pick, instruction):
            shares = torch.tensordot(torch.tensor(pick.shares), pick_seen, 1)
            return things_of_kind(image, shares, self._pixel_size, packed)
        if not packed or place.shares[0] <= _LIKELY or not self._is_unknown(pick, instruction):
            return ThingsOfKind(None, 0.0)
        things = unpacked(image, place_seen[0], self._pixel_size)
        kinds = self._scene.kind_head(self._scene.features(image))[0]
        return ThingsOfKind(self._kin.leads(instruction, things, kinds), 0.0)

    def _outlined(self, image: Tensor, pick: Meant, maps: Mapping[str, Tensor]) -> Outlined | None:
        """Return the things of the outline and of the colours that are to be picked; None if no outline is named."""
        if self._shapes is None or not pick.shape:
            return None
        outlined = self._shapes.look(image, pick.shape)
        if not pick.colors or not len(outlined.shares):
            return outlined
        seen = torch.stack([maps[color] for color in pick.colors]).amax(0)
        inside = F.avg_pool2d(outlined.cells.float(), outlined.cells.shape[-1] // seen.shape[-1])
        whole = inside.floor()  # colours at its edge are mixed with the table's
        inside = torch.where(whole.sum((1, 2), keepdim=True) > 0, whole, inside)
        return outlined._replace(shares=outlined.shares * (inside * seen).sum((1, 2)) / inside.sum((1, 2)))

    def _shape(self, kind: int) -> str:
        """Return a kind as SHAPES call it, should it be one of them."""
        return self.vocabulary.kinds[kind].removesuffix(" shape")

    def _is_by_kind(self, pick: Meant, instruction: str) -> bool:
        """Return True if an instruction calls what is to be picked by a known kind's own words, and by no colour."""
        kind = self.vocabulary.kinds[pick.kinds[0]]
        is_known = pick.shares[0] > KNOWN and is_single(kind) and is_called(kind, instruction)
        return is_known and not pick.colors and not pick.shape

    def _is_unknown(self, pick: Meant, instruction: str) -> bool:
        """Return True if no known kind's own words call what is to be picked, nor its outline."""
        kind = self.vocabulary.kinds[pick.kinds[0]]
        is_known = pick.shares[0] > _LIKELY and (is_called(kind, instruction) or not is_everyday(kind))
        return not pick.shape and not is_known

    def _by_kind(self, role: Meant, seen: Tensor) -> Missing:
        """Return how likely a thing is missing, by its kind; seen: (K, h, w), of `_seen`."""
        known = torch.tensor(role.shares)
        present = float((known * seen.flatten(1).amax(1)).sum() + 1 - known.sum())
        return Missing(1.0 - present, spoken(self.vocabulary.kinds[role.kinds[0]], role.colors), sum(role.shares))

    def _by_outline(self, pick: Meant, outlined: Outlined, by_kind: Missing) -> Missing:
        """Return how likely what is to be picked is missing by its outline, or by its kind where that finds it."""
        probability = 1.0 - shifted(outlined.most(), _OUTLINE_BIAS)
        if self._shape(pick.kinds[0]) == pick.shape and by_kind.probability <= probability:
            return by_kind
        return Missing(probability, spoken(pick.shape, pick.colors), 1.0, is_outline=True)

    def _shade(self, color: str) -> Sequence[float] | None:
        """Return a colour's scaled CIELAB, None for a basic term that no demonstration names."""
        return self.vocabulary.shade(color) or surveyed_shade(color)

    def _seen(self, role: Meant, features: Tensor, maps: list[Tensor]) -> Tensor:
        """Return how likely each cell holds each kind that a role may mean, in any of its colours: (K, h, w).

        maps: where each of its colours is seen.
        """
        each = max(len(maps), 1)
        rows, cols = (2 * size for size in features.shape[-2:])
        seen = torch.stack(maps) if maps else features.new_zeros(1, rows, cols)
        kinds = torch.tensor(role.kinds)[None].repeat_interleave(each, dim=1)
        any_color = torch.full_like(kinds, not maps, dtype=torch.bool)
        asked = evidence(seen.repeat(len(role.kinds), 1, 1)[None], any_color)
        logits = self._scene.score(features, asked, kinds, torch.zeros_like(kinds))
        return logits.unflatten(1, (-1, each)).amax(2)[0].sigmoid()

    @torch.inference_mode()
    def _meant(self, instruction: str) -> tuple[Meant, Meant]:
        """Return what an instruction means to have picked, and where it is to be placed."""
        tokens, mask = self._encoder.encode([instruction])
        kinds, roles = self._sentence(tokens, mask)
        colors: dict[Role, list[str]] = {role: [] for role in Role}
        shape = shape_to_pick(instruction)
        begins = shape.begins if shape else ()  # a colour before a shape's name is its own
        for begin, end in color_spans(instruction):
            inside = self._encoder.pieces.within(instruction, begin, end)[: roles.shape[1]]
            if inside.any():
                role = Role(int(roles[0, inside].softmax(-1).mean(0).argmax()))
                if role is Role.NEITHER and end + 1 in begins:
                    role = Role.PICK
                colors[role].append(_term(instruction[begin:end].lower()))
        pick, place = kinds[0].softmax(-1)
        picked, placed = self._read(pick, colors[Role.PICK]), self._read(place, colors[Role.PLACE])
        return picked._replace(shape=shape.name if shape and not self._is_other(picked) else ""), placed

    def _is_other(self, pick: Meant) -> bool:
        """Return True if what is to be picked is of a known kind that is no shape: the name is of something else."""
        known = zip(pick.kinds, pick.shares, strict=True)
        return sum(share for kind, share in known if self._shape(kind) not in SHAPES) >= 0.5

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
