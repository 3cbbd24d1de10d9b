"""Names of shapes that people know from books and signs: capital letters, digits and figures."""

from __future__ import annotations

import re
from typing import NamedTuple

LETTERS = tuple("ABCDEFGHIJKLMNOPQRSTUVWXYZ")
DIGITS = tuple("0123456789")
FIGURES = (
    "arrow", "circle", "crescent", "diamond", "flower", "heart", "hexagon", "octagon", "oval", "parallelogram",
    "pentagon", "plus", "rectangle", "ring", "semicircle", "square", "star", "trapezoid", "triangle",
)  # fmt: skip
SHAPES = (*(f"letter {letter}" for letter in LETTERS), *(f"number {digit}" for digit in DIGITS), *FIGURES)

_SYNONYMS = {
    "disc": "circle", "disk": "circle", "half moon": "crescent", "rhombus": "diamond", "lozenge": "diamond",
    "blossom": "flower", "ellipse": "oval", "cross": "plus", "doughnut": "ring", "donut": "ring",
    "half circle": "semicircle", "trapezium": "trapezoid",
}  # fmt: skip
_NUMERALS = ("zero", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine")
_LETTER = re.compile(r"\b(?:[Ll]etter|[Cc]apital) ([A-Za-z])\b|\b([A-Za-z])-shaped?\b|\b([B-HJ-Z]) shaped?\b")
_NUMBER = re.compile(rf"\b(?:number|digit|numeral) ([0-9]|{'|'.join(_NUMERALS)})\b", re.IGNORECASE)
_FIGURE = re.compile(rf"\b({'|'.join((*FIGURES, *_SYNONYMS))})(?:e?s)?\b", re.IGNORECASE)


class ShapeName(NamedTuple):
    """One of SHAPES, and where in a sentence the words for it begin."""

    name: str
    begins: tuple[int, ...]


def shape_named(sentence: str) -> ShapeName | None:
    """Return which of SHAPES a sentence names; None where it names none, or several."""
    found = [(f"letter {match[match.lastindex or 0].upper()}", match.start()) for match in _LETTER.finditer(sentence)]
    found += [(f"number {_digit(match[1].lower())}", match.start()) for match in _NUMBER.finditer(sentence)]
    figures = ((match[1].lower(), match.start()) for match in _FIGURE.finditer(sentence))
    found += [(_SYNONYMS.get(name, name), begin) for name, begin in figures]
    names = {name for name, _ in found}
    return ShapeName(names.pop(), tuple(begin for _, begin in found)) if len(names) == 1 else None


def _digit(word: str) -> str:
    return str(_NUMERALS.index(word)) if word in _NUMERALS else word
