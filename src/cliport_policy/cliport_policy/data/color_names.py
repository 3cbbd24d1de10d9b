"""Basic English colour terms, the shades that a survey found under each, and where a sentence names a colour.

The shades are those of the xkcd colour survey (2010, 200,000 people), as Matplotlib ships them: "dusty purple" and
"eggplant purple" are purples, "eggplant" alone is left out.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

# Berlin and Kay (1969), and cyan, which the paper's tasks name.
BASIC_TERMS = (
    "black", "white", "red", "green", "yellow", "blue",
    "brown", "orange", "pink", "purple", "gray", "cyan",
)  # fmt: skip
UNSEEN_STEMS = ("orang", "purpl", "pink", "whit")  # of the benchmark's colours that only test scenes have
_SPELLINGS = {"grey": "gray", **{term: term for term in BASIC_TERMS}}
_WORD = re.compile(rf"\b({'|'.join(_SPELLINGS)})\b", re.IGNORECASE)
# Names that things have, too: they name a colour before a word for another thing alone.
_ALSO_THINGS = ("brick", "leaf")
_OTHER_THING = re.compile(
    r"\s+(?:blocks?|cubes?|bowls?|dish(?:es)?|box(?:es)?|rings?|piles?|squares?|ones?)\b", re.IGNORECASE
)
# A shadow changes a colour's lightness more than its hue.
_WEIGHTS = np.array((0.4, 1.0, 1.0), np.float32)


def terms_in(sentence: str) -> list[str]:
    """Return the basic terms in a sentence, each once, in the order of their first mention."""
    return list(dict.fromkeys(_SPELLINGS[word.lower()] for word in _WORD.findall(sentence)))


def rename(sentence: str, terms: Mapping[str, str]) -> str:
    """Replace the basic terms of a sentence that `terms` maps to another."""

    def other(match: re.Match[str]) -> str:
        term = _SPELLINGS[match[0].lower()]
        return terms.get(term, match[0])

    return _WORD.sub(other, sentence)


def lab(colors: NDArray[np.uint8] | NDArray[np.float32]) -> NDArray[np.float32]:
    """Convert RGB 0..255 (N, 3) to CIELAB (N, 3)."""
    unit = np.asarray(colors, np.float32).reshape(1, -1, 3) / np.float32(255)
    out: NDArray[np.float32] = cv2.cvtColor(unit, cv2.COLOR_RGB2LAB)[0]
    return out


def rgb(colors: NDArray[np.float32]) -> NDArray[np.uint8]:
    """Convert CIELAB (N, 3) to the nearest RGB 0..255 (N, 3)."""
    unit = cv2.cvtColor(np.asarray(colors, np.float32).reshape(1, -1, 3), cv2.COLOR_LAB2RGB)[0]
    return np.rint(255 * np.clip(unit, 0, 1)).astype(np.uint8)


def distance(colors: NDArray[np.float32], shades: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return each colour's distance from the nearest shade (N,), of CIELAB (N, 3) and (M, 3).

    Lightness counts less than hue.
    """
    a, b = colors * _WEIGHTS, shades * _WEIGHTS
    squared = np.square(b).sum(1) - 2 * (a @ b.T)  # (N, M), less the colours' own squares
    out: NDArray[np.float32] = np.sqrt(np.maximum(squared.min(1) + np.square(a).sum(1), 0))
    return out


@lru_cache(maxsize=1)
def survey() -> dict[str, tuple[float, float, float]]:
    """Return the survey's 949 names and their colours, RGB 0..1."""
    from matplotlib.colors import XKCD_COLORS, to_rgb

    return {name.removeprefix("xkcd:"): to_rgb(code) for name, code in XKCD_COLORS.items()}


@lru_cache(maxsize=2)
def names_told(arm: str) -> dict[str, tuple[float, float, float]]:
    """Return the survey's names, as people write them, and their colours, RGB 0..1, that an arm is told.

    `open` is told all, `strict` none that holds a word of the unseen colours.
    """
    names = {name.replace("/", " "): color for name, color in survey().items()}
    return {name: color for name, color in names.items() if _is_told(name, arm)}


def terms_told(arm: str) -> list[str]:
    """Return the basic terms that an arm is told."""
    return [term for term in BASIC_TERMS if _is_told(term, arm)]


def shade_told(name: str, arm: str) -> tuple[float, float, float] | None:
    """Return the colour, RGB 0..1, of a name in small letters that an arm is told; None for a basic term."""
    name = name.replace("gray", "grey")
    return None if name in _SPELLINGS else names_told(arm).get(name)


def _is_told(name: str, arm: str) -> bool:
    return arm == "open" or not any(stem in name for stem in UNSEEN_STEMS)


def color_spans(sentence: str) -> list[tuple[int, int]]:
    """Return where a sentence has a colour's name: its first character, and the one after its last.

    "brick" is a thing in "the red brick" and a colour in "the brick bowl".
    """
    return [match.span() for match in _any_name().finditer(sentence) if not _is_thing(sentence, match)]


def _is_thing(sentence: str, name: re.Match[str]) -> bool:
    return name[0].lower() in _ALSO_THINGS and not _OTHER_THING.match(sentence, name.end())


@lru_cache(maxsize=1)
def _any_name() -> re.Pattern[str]:
    longest_first = sorted(names_told("open"), key=len, reverse=True)
    either = "|".join(map(re.escape, longest_first)).replace("grey", "gr[ae]y")
    return re.compile(rf"\b(?:{either})\b", re.IGNORECASE)


@lru_cache(maxsize=1)
def surveyed_shades() -> dict[str, NDArray[np.float32]]:
    """Return each basic term's shades, CIELAB (M, 3)."""
    found: dict[str, list[tuple[float, float, float]]] = {term: [] for term in BASIC_TERMS}
    for name, color in survey().items():
        term = _SPELLINGS.get(name.split()[-1])
        if term is not None:
            found[term].append(color)
    return {term: lab(255 * np.array(colors, np.float32)) for term, colors in found.items()}
