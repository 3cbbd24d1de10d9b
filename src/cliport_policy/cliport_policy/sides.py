"""Sides that sentences name: of several places that are alike the one that lies farthest there is meant.

As in the benchmark's sentences, top is towards the robot (-x) and left towards -y (docs/benchmark.md,
"assembling-kits-seq"), which is how the heightmap's columns and rows lie.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from enum import Enum

from cliport_policy.data.augmentation import names_own_frame


class Side(Enum):
    """Side of the table, or the middle between others."""

    TOP = "top"
    BOTTOM = "bottom"
    LEFT = "left"
    RIGHT = "right"
    MIDDLE = "middle"


_OTHER_WORDS = {"upper": Side.TOP, "lower": Side.BOTTOM, "leftmost": Side.LEFT, "rightmost": Side.RIGHT}
_WORDS = {side.value: side for side in Side} | _OTHER_WORDS
_EITHER = "|".join(_WORDS)
# Before a noun: not "the top of", nor a stand's side or shade, as in "the middle brown block".
_BEFORE_NOUN = rf"\b(?:the|a|an|its|that|this)\s+({_EITHER})\s+(?!(?:of|side|end|edge|corner|tip|brown)\b)\w"
_BEHIND_NOUN = r"\b(?:on|at|to) the (left|right|top|bottom)(?=$|[.,!?])"
_NAMED = re.compile(f"{_BEFORE_NOUN}|{_BEHIND_NOUN}")


def side_named(instruction: str) -> Side | None:
    """Return the side of the place that a sentence names; None for none, for several, or for a rope's own corners."""
    text = " ".join(instruction.lower().split())
    found = {_WORDS[before or behind] for before, behind in _NAMED.findall(text)}
    return found.pop() if len(found) == 1 and not names_own_frame(text) else None


def at_side(side: Side, pixels: Sequence[tuple[int, int]]) -> int:
    """Return the index of the pixel (row, col) that lies at a side of the others; the middle one is next to their mean.

    There must be one at least.
    """
    middle = [sum(axis) / len(pixels) for axis in zip(*pixels, strict=True)]

    def far(index: int) -> float:
        row, col = pixels[index]
        return {
            Side.TOP: col,
            Side.BOTTOM: -col,
            Side.LEFT: row,
            Side.RIGHT: -row,
            Side.MIDDLE: math.dist((row, col), middle),
        }[side]

    return min(range(len(pixels)), key=far)
