"""Kinds of things that demonstrations list, and those that a canonical sentence names."""

from __future__ import annotations

import re
from collections.abc import Collection, Sequence
from typing import NamedTuple

from cliport_policy.data.named_things import named_things
from cliport_policy.shapes.names import SHAPES

ZONE = "zone"  # square on the table, which a pile is swept into or a rope laid along; another square is a shape
_SQUARE = "square"
_SPOKEN = {ZONE: "square", "small block": "block", "bead": "rope"}  # kinds that people call otherwise
_AT_ZONES = {"small block", "bead"}  # what lies where squares are zones, many at once
_CONTAINER = "brown box"  # what things are packed into
_HOLE = " hole"
_PLAIN = {"block", "bowl", "box", "ring", "kit", "stand", ZONE, _CONTAINER, *_AT_ZONES}  # told by colour or place


class NamedKinds(NamedTuple):
    """Kind of what a sentence has picked, and of what it is placed at."""

    pick: str
    place: str


def listed_kind(name: str, names: Collection[str]) -> str:
    """Return the kind of a listed thing of a scene that holds things of these names."""
    return ZONE if name == _SQUARE and not _AT_ZONES.isdisjoint(names) else name


def spoken(kind: str, colors: Sequence[str]) -> str:
    """Return what people call a kind in one of some colours, such as "red or blue bowl"."""
    return " ".join(filter(None, (" or ".join(colors), _SPOKEN.get(kind, kind))))


def is_single(kind: str) -> bool:
    """Return False for a kind of which many are handled at once, as a pile's blocks and a rope's beads are."""
    return kind not in _AT_ZONES


def is_container(kind: str) -> bool:
    """Return True for a kind that things are packed into."""
    return kind == _CONTAINER


def is_everyday(kind: str) -> bool:
    """Return True for a kind that its looks tell, and neither its outline nor its colour alone."""
    return kind not in _PLAIN and not kind.endswith(_HOLE) and kind.removesuffix(" shape") not in SHAPES


def is_called(kind: str, sentence: str) -> bool:
    """Return True if a sentence has all words of a kind's name, in one of their forms ("rubber ducks")."""
    words = re.findall(r"\w+", sentence.lower())
    return all(any(word.startswith(part) for word in words) for part in kind.split())


def named_kinds(sentence: str) -> NamedKinds | None:
    """Return the kinds that a canonical sentence names; None for a sentence of another form."""
    named = named_things(sentence)
    if named is None:
        return None
    place = named.places[0][1]
    return NamedKinds(named.picks[0][1], ZONE if place == _SQUARE else place)
