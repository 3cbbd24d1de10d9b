"""The benchmark's eleven colours and its two palettes (docs/benchmark.md, "Colours")."""

from __future__ import annotations

import numpy as np

from sim_bridge.errors import UnknownNameError

Rgb = tuple[int, int, int]

# the order matters: distractors take their colours in it
COLORS: dict[str, Rgb] = {
    "blue": (78, 121, 167),
    "red": (255, 87, 89),
    "green": (89, 169, 79),
    "orange": (242, 142, 43),
    "yellow": (237, 201, 72),
    "purple": (176, 122, 161),
    "pink": (255, 157, 167),
    "cyan": (118, 183, 178),
    "brown": (156, 117, 95),
    "white": (255, 255, 255),
    "gray": (186, 176, 172),
}
SEEN_PALETTE = ("blue", "red", "green", "yellow", "brown", "gray", "cyan")
UNSEEN_PALETTE = ("blue", "red", "green", "orange", "purple", "pink", "white")


def rgb(name: str) -> Rgb:
    """Return a colour name's RGB, 0..255.

    Raises:
        UnknownNameError: when the benchmark has no such colour.
    """
    if name not in COLORS:
        raise UnknownNameError("colour", name, COLORS)
    return COLORS[name]


def random_brown(rng: np.random.Generator) -> Rgb:
    """Draw a lighter or darker brown (docs/benchmark.md, "Colours")."""
    shade = rng.uniform(0.5, 1.5)
    r, g, b = (round(shade * channel) for channel in COLORS["brown"])
    return r, g, b
