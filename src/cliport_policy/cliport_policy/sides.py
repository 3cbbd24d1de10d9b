"""Sides that sentences name: of several places that are alike the one that lies farthest there is meant.

As in the benchmark's sentences, top is towards the robot (-x) and left towards -y (docs/benchmark.md,
"assembling-kits-seq"), which is how the heightmap's columns and rows lie. A thing with a front of its own, as a rope's
square, has sides of its own: its left is at the left hand of who looks from its back to its front.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from enum import Enum
from typing import NamedTuple

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
_INTO = r"\b(?:in|into|inside|on|onto|within|to)"
_PLACE_FIRST = re.compile(rf"(?:{_INTO}|\b(?:cover|fill|load|use|with))\s+$")  # words right before what they govern
_WITH = re.compile(r"\bwith\b")
_LEADS = re.compile(rf"{_INTO}\b|{_WITH.pattern}")
_TO_PLACE = re.compile(rf"{_INTO}\s+(?:the|a|an|its|that|this|each|every|any)\b")

_OWN_CORNER = re.compile(r"\b(?:front|back) (left|right) (?:tip|corner)\b")
_FRONT, _BACK = ("front left tip", "front right tip"), ("back right corner", "back left corner")


class OwnSide(NamedTuple):
    """Left or right side of a thing that has a front of its own, and the same sentence about its front and its back."""

    side: Side
    front: str
    back: str


def own_side_named(instruction: str) -> OwnSide | None:
    """Return the one side of a thing's own between whose two corners a sentence goes; None for any other sentence."""
    text = " ".join(instruction.lower().split())
    named = _OWN_CORNER.findall(text)
    if len(named) != 2 or named[0] != named[1] or not names_own_frame(text):
        return None
    return OwnSide(Side(named[0]), _between(text, _FRONT), _between(text, _BACK))


def _between(text: str, corners: Sequence[str]) -> str:
    words = iter(corners)
    return _OWN_CORNER.sub(lambda _: next(words), text)


def at_own_side(
    side: Side,
    front: Sequence[tuple[float, float]],
    back: Sequence[tuple[float, float]],
    places: Sequence[tuple[float, float]],
) -> list[int]:
    """Return the indices of the places that lie at the left or the right of a thing.

    front, back: where its front and its back are, one place of each at least. All are x, y [m] in the base frame.
    """
    (front_x, front_y), (back_x, back_y) = (_mean(points) for points in (front, back))
    ahead_x, ahead_y = front_x - back_x, front_y - back_y
    to_left = 1.0 if side is Side.LEFT else -1.0
    middle_x, middle_y = (front_x + back_x) / 2, (front_y + back_y) / 2
    return [
        index
        for index, (x, y) in enumerate(places)
        if to_left * (ahead_x * (y - middle_y) - ahead_y * (x - middle_x)) > 0
    ]


def _mean(points: Sequence[tuple[float, float]]) -> tuple[float, float]:
    xs, ys = zip(*points, strict=True)
    return sum(xs) / len(xs), sum(ys) / len(ys)


def side_named(instruction: str) -> Side | None:
    """Return the side of the place that a sentence names; None for none, for several, or for a rope's own corners.

    A side of what is picked, "put the left block in a bowl", is none of the place's.
    """
    text = " ".join(instruction.lower().split())
    found = {_WORDS[named[1] or named[2]] for named in _NAMED.finditer(text) if not _is_picks(text, named)}
    return found.pop() if len(found) == 1 and not names_own_frame(text) else None


def _is_picks(text: str, named: re.Match[str]) -> bool:
    """Return True for a side of what is picked: of no hole, after "with", or where other words lead to the place."""
    if "hole" in _LEADS.split(text[named.start() :])[0]:
        return False
    governing = _PLACE_FIRST.search(text[: named.start()])
    if governing is not None:
        return governing[0].strip() == "with"
    return named[1] is not None and _TO_PLACE.search(text) is not None and _WITH.search(text, named.end()) is None


def at_side(side: Side, pixels: Sequence[tuple[int, int]], taken: Sequence[tuple[int, int]] = ()) -> int | None:
    """Return the index of the pixel (row, col) that lies at a side of the others, of which there must be one at least.

    The middle one is that next to the mean of all, and of taken ones, too, which no other word would name; None where
    there are only two.
    """
    everything = [*pixels, *taken]
    if side is Side.MIDDLE and len(everything) < 3:
        return None
    middle = [sum(axis) / len(everything) for axis in zip(*everything, strict=True)]
    at_none = [index for index, pixel in enumerate(pixels) if not _is_at_a_side(pixel, everything)]
    allowed = at_none if side is Side.MIDDLE and at_none else range(len(pixels))

    def far(index: int) -> float:
        row, col = pixels[index]
        return {
            Side.TOP: col,
            Side.BOTTOM: -col,
            Side.LEFT: row,
            Side.RIGHT: -row,
            Side.MIDDLE: math.dist((row, col), middle),
        }[side]

    return min(allowed, key=far)


def _is_at_a_side(pixel: tuple[int, int], everything: Sequence[tuple[int, int]]) -> bool:
    """Return True for what is nearest to the robot or farthest, more so than sideways, and for what is outermost."""
    away = [(other[1] - pixel[1], other[0] - pixel[0]) for other in everything if other != pixel]  # along x and y
    along_x = all(abs(x) > abs(y) for x, y in away)
    return any(
        (along_x and all(sign * x > 0 for x, _ in away)) or all(sign * y > 0 for _, y in away) for sign in (1, -1)
    )
