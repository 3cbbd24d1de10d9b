"""Other wordings of the benchmark's canonical sentences, filled from patterns with slots (phrasings.yaml)."""

from __future__ import annotations

import re
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
import yaml

PATH = Path(__file__).parent / "phrasings.yaml"
_COLOR_SLOTS = ("color", "first", "second", "zone")  # of one word each
_OPTIONAL_SLOT = "side"  # of one word with a space behind it, or none
_VERB_SLOTS = {"v": "put", "g": "pack"}  # slot of a pattern, list of the file


class Phrasing(NamedTuple):
    """Canonical sentence as a pattern that finds its slots, and the patterns of its other wordings."""

    sentence: re.Pattern[str]
    patterns: tuple[str, ...]


class Phrasings(NamedTuple):
    """All tasks' wordings, and the verbs of each verb slot."""

    tasks: tuple[Phrasing, ...]
    verbs: dict[str, tuple[str, ...]]


@lru_cache(maxsize=1)
def phrasings() -> Phrasings:
    """Return the shipped wordings."""
    values = yaml.safe_load(PATH.read_text(encoding="utf-8"))
    tasks = tuple(Phrasing(_finder(task["sentence"]), tuple(task["patterns"])) for task in values["tasks"])
    return Phrasings(tasks, {slot: tuple(values[name]) for slot, name in _VERB_SLOTS.items()})


def reword(sentence: str, rng: np.random.Generator) -> str | None:
    """Return a random wording of a canonical sentence; None for a sentence of another kind."""
    known = phrasings()
    for task in known.tasks:
        match = task.sentence.fullmatch(sentence)
        if match:
            pattern = task.patterns[int(rng.integers(len(task.patterns)))]
            verbs = {slot: words[int(rng.integers(len(words)))] for slot, words in known.verbs.items()}
            return pattern.format(**match.groupdict(), **verbs)
    return None


def says_all(wording: str, sentence: str) -> bool:
    """Return True if a wording of a canonical sentence names all that the sentence names; True for other sentences."""
    for task in phrasings().tasks:
        if match := task.sentence.fullmatch(sentence):
            return all(
                re.search(rf"\b{re.escape(named.strip())}\b", wording, re.IGNORECASE) for named in match.groups()
            )
    return True


def is_imperative(sentence: str) -> bool:
    """Return True if a wording begins with a verb of the lists, so that "please" may stand before it."""
    return any(sentence.startswith(f"{verb} ") for verbs in phrasings().verbs.values() for verb in verbs)


def _finder(sentence: str) -> re.Pattern[str]:
    """Return what finds a sentence's slots; one that stands there twice has the same words both times."""
    known: set[str] = set()

    def group(match: re.Match[str]) -> str:
        slot = match[1]
        if slot in known:
            return f"(?P={slot})"
        known.add(slot)
        words = r"(?:[a-z]+ )?" if slot == _OPTIONAL_SLOT else r"[a-z]+" if slot in _COLOR_SLOTS else ".+?"
        return f"(?P<{slot}>{words})"

    return re.compile(re.sub(r"\\?\{(\w+)\\?\}", group, re.escape(sentence)))
