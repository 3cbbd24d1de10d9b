"""Confusions of evaluated episodes by attribute: what was picked, and placed at, in place of what was asked for."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator
from enum import Enum
from typing import NamedTuple

from cliport_benchmark.episode import Step
from cliport_policy.data.color_names import BASIC_TERMS
from cliport_policy.data.named_things import Kind, named_things


class Confusion(Enum):
    """Difference between what was chosen and what was asked for; the value heads a table's column."""

    NONE = "right"
    COLOR = "other colour"
    THING = "other thing"
    ONE = "another one like it"
    BESIDE = "nothing there"


class Judged(NamedTuple):
    """A pick, or a place: what was asked for, what was chosen, and how these differ."""

    is_pick: bool
    asked: tuple[Kind, ...]
    chosen: Kind
    confusion: Confusion


def judged(steps: Iterable[Step]) -> Iterator[Judged]:
    """Yield each step's pick, and its place where the pick was right: of another thing no place is asked for.

    A step whose sentence names no things is left out.
    """
    for step in steps:
        named = named_things(step.instruction)
        if named is None:
            continue
        yield _judged(True, step.pick_right, step.picked, named.picks, named.places)
        if step.pick_right:
            yield _judged(False, step.place_right, step.place_at, named.places, ())


def counts(of: Iterable[Judged], is_pick: bool) -> Counter[Confusion]:
    """Count how picks, or places, differ from what was asked for."""
    return Counter(one.confusion for one in of if one.is_pick is is_pick)


def confused_colors(of: Iterable[Judged]) -> Counter[tuple[str, str]]:
    """Count what was chosen where a thing of another colour was asked for: (asked, chosen)."""
    found = Counter[tuple[str, str]]()
    for one in of:
        if one.confusion is Confusion.COLOR:
            color, name = one.chosen
            wanted = " or ".join(dict.fromkeys(asked for asked, other in one.asked if asked and other == name))
            found[f"{wanted} {name}", f"{color} {name}"] += 1
    return found


def _judged(is_pick: bool, right: bool, chosen: str, asked: tuple[Kind, ...], others: tuple[Kind, ...]) -> Judged:
    kind = _kind(chosen, (*asked, *others))
    colors = {color for color, name in asked if name == kind[1]}
    if right:
        confusion = Confusion.NONE
    elif not chosen:
        confusion = Confusion.BESIDE
    elif not colors:
        confusion = Confusion.THING
    else:
        confusion = Confusion.ONE if kind[0] in colors or None in colors else Confusion.COLOR
    return Judged(is_pick, asked, kind, confusion)


def _kind(described: str, named: tuple[Kind, ...]) -> Kind:
    """Split a description, "red block", into colour and name, but for one that is a name of its own, "brown box"."""
    color, _, name = described.partition(" ")
    own = described in {other for _, other in named} or not name or color not in BASIC_TERMS
    return (None, described) if own else (color, name)
