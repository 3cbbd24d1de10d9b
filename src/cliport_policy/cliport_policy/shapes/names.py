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
_HOLE = re.compile(r"(?: shape)? hole", re.IGNORECASE)
_WHERE = re.compile(
    r"\b(?:in|into|inside|on|onto|upon|over|under|to|towards?|at|by|near|beside|next to)"
    r" (?:the|a|an|this|that) (?:[\w-]+ ){0,2}$",
    re.IGNORECASE,
)  # before what is a place
# After a figure's name: "the star goes there", but not "the star anise", nor "the flower pot".
_AFTER_NOUNS = (
    "shape", "shaped", "piece", "part", "block", "thing", "object", "one", "figure", "in", "into", "inside", "to",
    "on", "onto", "at", "by", "from", "with", "for", "near", "over", "under", "up", "down", "out", "off", "away",
    "and", "or", "but", "is", "are", "be", "was", "has", "have", "goes", "go", "gets", "should", "must", "can",
    "could", "will", "would", "needs", "belongs", "fits", "sits", "rests", "rest", "lies", "that", "which",
    "where", "there", "here", "sit", "fit", "lie", "stay", "end", "please", "now", "then", "next", "set", "put",
    "placed", "packed", "stowed", "dropped", "moved", "pushed", "it", "its", "hole",
)  # fmt: skip
_FIGURE = re.compile(
    rf"\b({'|'.join((*FIGURES, *_SYNONYMS))})(?:e?s)?\b(?!-(?!shape)| (?!(?:{'|'.join(_AFTER_NOUNS)})\b))",
    re.IGNORECASE,
)


class ShapeName(NamedTuple):
    """One of SHAPES, and where in a sentence the words for it begin."""

    name: str
    begins: tuple[int, ...]


def shape_to_pick(sentence: str) -> ShapeName | None:
    """Return which of SHAPES a sentence wants to have picked; None where it names none, or several.

    A hole is none, nor is what something is to be put on or in: "the star" of "put the mug on the star".
    """
    found = [(f"letter {match[match.lastindex or 0].upper()}", match) for match in _LETTER.finditer(sentence)]
    found += [(f"number {_digit(match[1].lower())}", match) for match in _NUMBER.finditer(sentence)]
    figures = ((match[1].lower(), match) for match in _FIGURE.finditer(sentence))
    found += [(_SYNONYMS.get(name, name), match) for name, match in figures]
    picked = [(name, match.start()) for name, match in found if not _is_place(sentence, match)]
    names = {name for name, _ in picked}
    return ShapeName(names.pop(), tuple(begin for _, begin in picked)) if len(names) == 1 else None


def _is_place(sentence: str, match: re.Match[str]) -> bool:
    behind = sentence[match.end() :]
    return _HOLE.match(behind) is not None or _WHERE.search(sentence[: match.start()]) is not None


def _digit(word: str) -> str:
    return str(_NUMERALS.index(word)) if word in _NUMERALS else word
