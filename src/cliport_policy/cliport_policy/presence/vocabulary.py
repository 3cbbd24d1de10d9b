"""Kinds and colours that a presence network knows by number."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cliport_policy.data.color_names import lab
from cliport_policy.data.named_things import named_things
from cliport_policy.networks.joint.color_words import LAB_SCALE
from cliport_policy.presence.kinds import listed_kind


@dataclass(frozen=True)
class Vocabulary:
    """Kinds that demonstrations list, and the colours that their sentences name, each sorted.

    shades: scaled CIELAB of each of the colours, as the things that have it are painted.
    """

    kinds: tuple[str, ...]
    colors: tuple[str, ...]
    shades: tuple[tuple[float, ...], ...]

    @property
    def unknown(self) -> int:
        """Number that stands for any other kind."""
        return len(self.kinds)

    def kind(self, name: str) -> int:
        """Return a kind's number, `unknown` for another."""
        return self.kinds.index(name) if name in self.kinds else self.unknown

    def shade(self, name: str) -> tuple[float, ...] | None:
        """Return a colour's shade, None for another colour than those that are known."""
        return self.shades[self.colors.index(name)] if name in self.colors else None

    def color(self, name: str) -> int:
        """Return a colour's number from 1 on, 0 for another."""
        return self.colors.index(name) + 1 if name in self.colors else 0


def vocabulary_of(scenes: Iterable[Collection[str]], sentences: Iterable[str], paints: Mapping[str, int]) -> Vocabulary:
    """Return the kinds in scenes that hold things of these names, and the colours in canonical sentences.

    paints: 0xRRGGBB of things by the names of their colours.
    """
    kinds: set[str] = set()
    for names in scenes:
        kinds.update(listed_kind(name, names) for name in names)
    colors: set[str] = set()
    for sentence in sentences:
        named = named_things(sentence)
        colors |= named.colors() if named else set()
    known = tuple(sorted(colors & paints.keys()))
    shades = tuple(tuple(round(float(value), 4) for value in shade_of(paints[name])) for name in known)
    return Vocabulary(tuple(sorted(kinds)), known, shades)


def shade_of(rgb: int) -> NDArray[np.float32]:
    """Return the scaled CIELAB colour (3,) of 0xRRGGBB."""
    channels = [(rgb >> shift) & 0xFF for shift in (16, 8, 0)]
    return np.asarray(lab(np.array([channels], np.float32))[0] / LAB_SCALE, np.float32)
