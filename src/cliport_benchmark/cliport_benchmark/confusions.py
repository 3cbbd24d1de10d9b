"""Confusions of evaluated episodes by attribute: what was picked, and placed at, in place of what was asked for."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from enum import Enum

from cliport_benchmark.episode import Step
from cliport_policy.data.color_names import BASIC_TERMS
from cliport_policy.data.named_things import Kind, named_things


class Choice(Enum):
    """Kind of a choice; the value heads a table's column."""

    RIGHT = "right"
    COLOR = "other colour"
    THING = "other thing"
    ONE = "another one like it"
    NOTHING = "nothing there"


def kind_of(described: str) -> Kind:
    """Split a description, "red block", into a basic colour term, None for none, and a name."""
    color, _, name = described.partition(" ")
    return (color, name) if name and color in BASIC_TERMS else (None, described)


def choices_of(steps: Iterable[Step]) -> tuple[Counter[Choice], Counter[Choice]]:
    """Count the choices of picks and of places; steps whose sentence names no things are left out."""
    picks, places = Counter[Choice](), Counter[Choice]()
    for step in steps:
        named = named_things(step.instruction)
        if named is not None:
            picks[_choice(step.pick_right, step.picked, named.picks)] += 1
            places[_choice(step.place_right, step.place_at, named.places)] += 1
    return picks, places


def color_confusions(steps: Iterable[Step]) -> Counter[tuple[str, str]]:
    """Count which thing was picked or placed at where one of another colour was asked for: (asked, chosen)."""
    found = Counter[tuple[str, str]]()
    for step in steps:
        named = named_things(step.instruction)
        if named is None:
            continue
        for right, chosen, asked in (
            (step.pick_right, step.picked, named.picks),
            (step.place_right, step.place_at, named.places),
        ):
            if _choice(right, chosen, asked) is Choice.COLOR:
                name = kind_of(chosen)[1]
                wanted = " or ".join(dict.fromkeys(color for color, other in asked if color and other == name))
                found[f"{wanted} {name}", chosen] += 1
    return found


def _choice(right: bool, chosen: str, asked: tuple[Kind, ...]) -> Choice:
    if right:
        return Choice.RIGHT
    if not chosen:
        return Choice.NOTHING
    color, name = kind_of(chosen)
    colors = {wanted for wanted, other in asked if other == name}
    if not colors:
        return Choice.THING
    return Choice.ONE if color in colors or None in colors else Choice.COLOR
