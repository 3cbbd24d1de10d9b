"""Other ways to say a canonical instruction, for training: a network that met one wording only knows one wording.

The grammar is compositional: a frame orders the sentence, and its parts (verb, quantifier, noun, colour phrase,
politeness) are drawn on their own. The evaluation's phrasings are written apart from it and must not be added here.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import TypeVar

import numpy as np

from cliport_policy.data.phrasings import is_imperative, reword

T = TypeVar("T")

_CANONICAL = re.compile(r"^put the (?P<block>[a-z]+) blocks? in (?:a|the) (?P<bowl>[a-z]+) bowls?$")

_VERBS = (
    "put", "place", "move", "drop", "set", "lay", "transfer", "bring", "carry", "deposit", "stick", "stash",
    "relocate", "pick up and put", "grab and place", "take", "pick and place", "get", "sort",
)  # fmt: skip
_BLOCKS = (
    ("block", "blocks"),
    ("cube", "cubes"),
    ("block", "blocks"),
    ("brick", "bricks"),
    ("toy block", "toy blocks"),
    ("piece", "pieces"),
    ("object", "objects"),
    ("thing", "things"),
)
_BOWLS = (
    ("bowl", "bowls"),
    ("bowl", "bowls"),
    ("bowl", "bowls"),
    ("dish", "dishes"),
    ("basin", "basins"),
    ("container", "containers"),
    ("cup", "cups"),
    ("plate", "plates"),
)
_INTO = ("in", "in", "into", "inside", "inside of", "within", "to", "onto")
_OPENINGS = (
    "please ",
    "now ",
    "robot, ",
    "hey, ",
    "ok, ",
    "can you ",
    "could you ",
    "would you ",
    "could you please ",
    "i want you to ",
    "i would like you to ",
    "your task is to ",
    "you should ",
    "next, ",
    "go and ",
    "kindly ",
)
_GREETED_SHARE = 0.35  # of imperatives
_ENDINGS = (
    " please",
    ", please",
    " now",
    " for me",
    ", thanks",
    " thank you",
    " right away",
    " if you can",
    "!",
)

# {p} block phrase, {w} bowl phrase, {v} verb, {i} preposition, {h} "goes" or "go", {b} "belongs" or "belong"
_IMPERATIVE = (
    "{v} {p} {i} {w}",
    "{v} {p} {i} {w}",
    "{v} {p} {i} {w}",
    "{i} {w}, {v} {p}",
    "{i} {w} {v} {p}",
    "fill {w} with {p}",
    "use {w} to hold {p}",
    "find {p} and {v} them {i} {w}",
    "take {p} and {v} it {i} {w}",
    "look for {p}, then {v} it {i} {w}",
    "make sure {p} {e} {i} {w}",
    "collect {p} {i} {w}",
    "load {w} with {p}",
    "get {p} and leave it {i} {w}",
)
_STATEMENTS = (
    "{p} {h} {i} {w}",
    "{p} {b} {i} {w}",
    "{p} should be {i} {w}",
    "{p} must go {i} {w}",
    "{p} into {w}",
    "{p} in {w}",
    "{w} should hold {p}",
    "{w} gets {p}",
    "{w} is for {p}",
    "{w} needs {p}",
    "{w} is where {p} {h}",
    "i want {p} {i} {w}",
    "i would like {p} to be {i} {w}",
    "we need {p} {i} {w}",
    "{p} to {w}",
    "{i} {w} {h} {p}",
    "the place for {p} is {w}",
    "the goal is {p} {i} {w}",
)


def parse_canonical(instruction: str) -> tuple[str, str] | None:
    """Return (block colour, bowl colour) of a canonical sentence of put-blocks-in-bowls, None for any other."""
    match = _CANONICAL.match(instruction)
    return (match["block"], match["bowl"]) if match else None


def paraphrase(instruction: str, rng: np.random.Generator) -> str:
    """Return another wording of a canonical instruction; a sentence of another kind is returned unchanged."""
    if rng.random() < 0.1:
        return instruction
    colors = parse_canonical(instruction)
    if colors is None:
        sentence = reword(instruction, rng)
        greeted_share = _GREETED_SHARE if sentence and is_imperative(sentence) else 0.0
        return instruction if sentence is None else _dressed(sentence, rng, greeted_share)
    plural = rng.random() < 0.5
    block = _thing_phrase(colors[0], _BLOCKS, plural, rng)
    bowl = _thing_phrase(colors[1], _BOWLS, rng.random() < 0.15, rng)
    imperative = rng.random() < 0.6
    frame = _pick(_IMPERATIVE if imperative else _STATEMENTS, rng)
    sentence = frame.format(
        p=block,
        w=bowl,
        v=_pick(_VERBS, rng),
        i=_pick(_INTO, rng),
        h="go" if plural else "goes",
        b="belong" if plural else "belongs",
        e="are" if plural else "is",
    )
    return _dressed(sentence, rng, _GREETED_SHARE if imperative else 0.0)


def _thing_phrase(color: str, nouns: tuple[tuple[str, str], ...], plural: bool, rng: np.random.Generator) -> str:
    noun = _pick(nouns, rng)[1 if plural else 0]
    quantifiers = (
        ("the", "the", "all", "all the", "all of the", "the", "any", "", "these", "those")
        if plural
        else ("the", "the", "every", "each", "a", "any", "one", "that", "")
    )
    quantifier = _pick(quantifiers, rng)
    form = rng.random()
    if form < 0.7:
        phrase = f"{color} {noun}"
    elif form < 0.78:
        phrase = f"{color} colored {noun}"
    elif form < 0.84:
        phrase = f"{color}-coloured {noun}"
    elif form < 0.92:
        phrase = f"{noun} that {'are' if plural else 'is'} {color}"
    else:
        phrase = f"{noun} which {'are' if plural else 'is'} {color}" if rng.random() < 0.5 else f"{noun} in {color}"
    return f"{quantifier} {phrase}".strip()


def _dressed(sentence: str, rng: np.random.Generator, greeted_share: float = 0.0) -> str:
    if greeted_share and rng.random() < greeted_share:
        sentence = _pick(_OPENINGS, rng) + sentence
    if rng.random() < 0.3:
        sentence += _pick(_ENDINGS, rng)
    return _finish(sentence, rng)


def _finish(sentence: str, rng: np.random.Generator) -> str:
    if rng.random() < 0.25:
        sentence = sentence[0].upper() + sentence[1:]
    if rng.random() < 0.2 and not sentence.endswith("!"):
        sentence += "."
    return sentence


def _pick(options: Sequence[T], rng: np.random.Generator) -> T:
    return options[int(rng.integers(len(options)))]
