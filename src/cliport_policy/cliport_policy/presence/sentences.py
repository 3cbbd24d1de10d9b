"""Sentences to learn kinds and colours' roles from: the benchmark's own, reworded, some with names of other things."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from cliport_policy.data.color_names import BASIC_TERMS, color_spans, names_told
from cliport_policy.data.paraphrase import paraphrase
from cliport_policy.data.phrasings import says_all
from cliport_policy.data.strange_words import STRANGE_NAMES, STRANGE_OBJECTS
from cliport_policy.presence.color_evidence import ARM
from cliport_policy.presence.kinds import named_kinds
from cliport_policy.presence.sentence_net import Role
from cliport_policy.presence.vocabulary import Vocabulary

# Sentences whose colours are a choice, and the role of each.
_COLORED = tuple(
    (re.compile(pattern), roles)
    for pattern, roles in (
        (r"put the (\w+) blocks in a (\w+) bowl", (Role.PICK, Role.PLACE)),
        (r"put the (\w+) .+ in the .*hole", (Role.PICK,)),
        (r"pack all the (\w+) and (\w+) blocks into the brown box", (Role.PICK, Role.PICK)),
        (r"pack all the (\w+) blocks into the brown box", (Role.PICK,)),
        (r"put the (\w+) block on the .+ blocks?", (Role.PICK,)),
        (r"push the pile of (\w+) blocks into the (\w+) square", (Role.PICK, Role.PLACE)),
        (r"move the (\w+) ring to the .+", (Role.PICK,)),
    )
)
_PLAIN = ("block", "box", "ring", "bead", "small block")  # kinds that have no name of their own
_STRANGE = 0.35  # share of the sentences that name something, which name something else instead
_OTHER_COLOR = 0.4  # share of these whose name only has another colour, where it holds one
_COLORED_STRANGE = 0.4  # share of strange objects with a colour
_ELSEWHERE = 0.3  # share of strange shapes that are called what things of other tasks are
_SURVEY = 0.35  # share of the sentences with colours by other than basic names


class Example(NamedTuple):
    """Sentence with the numbers of its kinds, and the role of each colour's name by (first, last + 1) character."""

    sentence: str
    pick: int
    place: int
    roles: tuple[tuple[tuple[int, int], Role], ...]


def draw_examples(
    sentences: Sequence[Sequence[str]], vocabulary: Vocabulary, count: int, rng: np.random.Generator
) -> list[Example]:
    """Return examples from canonical sentences, those of each group alike often."""
    groups = [[sentence for sentence in group if named_kinds(sentence)] for group in sentences]
    groups = [group for group in groups if group]
    found: list[Example] = []
    while len(found) < count:
        group = groups[int(rng.integers(len(groups)))]
        found.append(_example(group[int(rng.integers(len(group)))], vocabulary, rng))
    return found


def _example(sentence: str, vocabulary: Vocabulary, rng: np.random.Generator) -> Example:
    named = named_kinds(sentence)
    assert named is not None
    pick, place = vocabulary.kind(named.pick), vocabulary.kind(named.place)
    said, roles = _recolored(sentence, rng)
    if named.pick not in _PLAIN and rng.random() < _STRANGE:
        is_shape = named.place.endswith(" hole") or f"{named.pick} hole" in vocabulary.kinds
        said = said.replace(named.pick, _strange(named.pick, is_shape, rng))
        pick = vocabulary.unknown
        place = vocabulary.unknown if named.place.endswith(" hole") else place
    whole = said
    said = paraphrase(whole, rng)
    if not says_all(said, whole):  # "the red piece", of whatever shape
        pick, place = vocabulary.unknown, vocabulary.unknown
    if roles and rng.random() < _SURVEY:
        said, roles = _with_other_names(said, roles, rng)
    spans = [(span, roles.get(said[slice(*span)].lower(), Role.NEITHER)) for span in color_spans(said)]
    return Example(said, pick, place, tuple(spans))


def _recolored(sentence: str, rng: np.random.Generator) -> tuple[str, dict[str, Role]]:
    """Return a canonical sentence with basic terms for its colours, all different, and the role of each."""
    for pattern, roles in _COLORED:
        if match := pattern.fullmatch(sentence):
            terms = [str(term) for term in rng.choice(BASIC_TERMS, len(roles), replace=False)]
            for group in range(len(roles), 0, -1):
                begin, end = match.span(group)
                sentence = sentence[:begin] + terms[group - 1] + sentence[end:]
            return sentence, dict(zip(terms, roles, strict=True))
    return sentence, {}


def _strange(name: str, is_shape: bool, rng: np.random.Generator) -> str:
    """Return a name that is not known instead of a shape's or an object's."""
    if is_shape:
        return _drawn(_PLAIN if rng.random() < _ELSEWHERE else STRANGE_NAMES, rng)
    spans = color_spans(name)
    if spans and rng.random() < _OTHER_COLOR:
        begin, end = spans[0]
        own = name[begin:end].replace("grey", "gray")
        return name[:begin] + _drawn([term for term in BASIC_TERMS if term != own], rng) + name[end:]
    strange = _drawn(STRANGE_OBJECTS, rng)
    return f"{_drawn(BASIC_TERMS, rng)} {strange}" if rng.random() < _COLORED_STRANGE else strange


def _with_other_names(sentence: str, roles: dict[str, Role], rng: np.random.Generator) -> tuple[str, dict[str, Role]]:
    """Return a sentence with names of the survey for its colours, and the roles of these."""
    names = [name for name in names_told(ARM) if len(name.split()) <= 2 and name not in roles]
    drawn = dict(zip(roles, (str(name) for name in rng.choice(names, len(roles), replace=False)), strict=True))
    terms = re.compile(rf"\b({'|'.join(roles)})\b", re.IGNORECASE)
    said = terms.sub(lambda match: drawn[match[0].lower()], sentence)
    return said, {drawn[term]: role for term, role in roles.items()}


def _drawn(options: Sequence[str], rng: np.random.Generator) -> str:
    return options[int(rng.integers(len(options)))]
