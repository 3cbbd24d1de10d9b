"""Things that a canonical sentence of the benchmark names, to tell whether they lie on the table."""

from __future__ import annotations

import re
from collections.abc import Collection
from typing import NamedTuple

Kind = tuple[str | None, str]  # colour, None for any, and name


class NamedThings(NamedTuple):
    """Things that a sentence needs: one of `picks`, and all of `places`."""

    picks: tuple[Kind, ...]
    places: tuple[Kind, ...]

    def are_among(self, things: Collection[tuple[str, str]]) -> bool:
        """Return True if the things (colour, name) of a scene hold what is needed."""
        return any(_is_among(kind, things) for kind in self.picks) and all(
            _is_among(kind, things) for kind in self.places
        )

    def colors(self) -> set[str]:
        """Return the colours that are named."""
        return {color for color, _ in (*self.picks, *self.places) if color}


def _is_among(kind: Kind, things: Collection[tuple[str, str]]) -> bool:
    color, name = kind
    return any(name == other and color in (None, shown) for shown, other in things)


_STAND, _BROWN_BOX = (None, "stand"), (None, "brown box")


def named_things(sentence: str) -> NamedThings | None:
    """Return what a canonical sentence names; None for a sentence of another kind."""
    for pattern, read in _READERS:
        match = pattern.fullmatch(sentence)
        if match:
            return read(match)
    return None


def _blocks_in_bowl(match: re.Match[str]) -> NamedThings:
    return NamedThings(((match[1], "block"),), ((match[2], "bowl"),))


def _piece_in_hole(match: re.Match[str]) -> NamedThings:
    return NamedThings(((match[1], match[2]),), ((None, f"{match[2]} hole"),))


def _boxes_in_box(match: re.Match[str]) -> NamedThings:
    colors = [color for color in match.groups() if color]
    return NamedThings(tuple((color, "box") for color in colors), (_BROWN_BOX,))


def _object_in_box(match: re.Match[str]) -> NamedThings:
    return NamedThings(((None, match[1]),), (_BROWN_BOX,))


def _block_on_stand(match: re.Match[str]) -> NamedThings:
    return NamedThings(((match[1], "block"),), (_STAND,))


def _pile_in_square(match: re.Match[str]) -> NamedThings:
    return NamedThings(((match[1], "small block"),), ((match[2], "square"),))


def _ring_on_stand(match: re.Match[str]) -> NamedThings:
    return NamedThings(((match[1], "ring"),), (_STAND,))


def _rope(match: re.Match[str]) -> NamedThings:
    return NamedThings(((None, "bead"),), ((None, "square"),))


_READERS = tuple(
    (re.compile(pattern), read)
    for pattern, read in (
        (r"put the (\w+) blocks in a (\w+) bowl", _blocks_in_bowl),
        (r"put the (\w+) (.+) in the (?:(?:top|bottom|left|right|middle) )?\2 hole", _piece_in_hole),
        (r"pack all the (\w+)(?: and (\w+))? blocks into the brown box", _boxes_in_box),
        (r"pack all the (.+) objects in the brown box", _object_in_box),
        (r"pack the (.+) in the brown box", _object_in_box),
        (r"put the (\w+) block on the .+ blocks?", _block_on_stand),
        (r"push the pile of (\w+) blocks into the (\w+) square", _pile_in_square),
        (r"move the (\w+) ring to the .+", _ring_on_stand),
        (r"align the rope from .+", _rope),
    )
)
