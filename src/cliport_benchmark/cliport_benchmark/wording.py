"""Sentences of an evaluation: the task's own, or new phrasings and colour words that training never saw."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from cliport_benchmark.errors import OptionError
from sim_bridge.colors import COLORS
from sim_bridge.tasks import Task

_HELD_OUT = {
    "align-rope": "align-rope",
    "assembling-kits-seq": "assembling-kits-seq",
    "packing-box-pairs": "packing-box-pairs",
    "packing-seen-google-objects-group": "packing-google-objects-group",
    "packing-seen-google-objects-seq": "packing-shapes",
    "packing-unseen-google-objects-group": "packing-google-objects-group",
    "packing-unseen-google-objects-seq": "packing-shapes",
    "packing-unseen-shapes": "packing-shapes",
    "put-blocks-in-bowls": "put-blocks-in-bowls",
    "separating-piles": "separating-piles",
    "stack-block-pyramid-seq": "stack-block-pyramid-seq",
    "towers-of-hanoi-seq": "towers-of-hanoi-seq",
}  # tasks by the beginning of their names, and the files of their wordings


@dataclass(frozen=True)
class Wording:
    """patterns with the slots of a task's sentence: episode i gets pattern i mod n; none: the task's own sentence.

    synonyms: colour names of the benchmark and the words to say instead.
    """

    patterns: tuple[str, ...] = ()
    synonyms: dict[str, str] = field(default_factory=dict)

    def sentence(self, own: str, slots: Mapping[str, str], index: int) -> str:
        """Return what to say in the episode of that index; own: the task's pattern, slots: the word of each."""
        sentence = self.patterns[index % len(self.patterns)] if self.patterns else own
        for slot, word in slots.items():
            sentence = sentence.replace(f"{{{slot}}}", self._other_words(word))
        return sentence

    def _other_words(self, text: str) -> str:
        """Return the words of a slot with each colour said otherwise, also where a slot names several things."""
        if not self.synonyms:
            return text
        colors = "|".join(map(re.escape, self.synonyms))
        return re.sub(rf"\b(?:{colors})\b", lambda found: self.synonyms[found.group()], text)


def held_out_patterns(task: Task) -> tuple[str, ...]:
    """Return the wordings of a task that no training may use.

    Raises:
        OptionError: for a task that has none.
    """
    for beginning, name in _HELD_OUT.items():
        if task.name.startswith(beginning):
            return load_patterns(Path(__file__).parent / "phrasings" / f"{name}.txt", task.sentence_pattern)
    raise OptionError(f"{task.name} has no held-out wordings: choose one of the 18 language splits")


def load_patterns(path: Path, own: str) -> tuple[str, ...]:
    """Load patterns, one a line, with the slots of the task's own; empty lines and lines that begin with # are skipped.

    Raises:
        OptionError: when the file cannot be read, has no pattern, or a pattern lacks a slot.
    """
    patterns = _lines(path, "--phrasings")
    slots = re.findall(r"\{\w+\}", own)
    for number, pattern in patterns:
        missing = [slot for slot in slots if slot not in pattern]
        if missing:
            raise OptionError(f"{path}, line {number}: the pattern lacks {' and '.join(missing)}")
    return tuple(pattern for _, pattern in patterns)


def load_synonyms(path: Path) -> dict[str, str]:
    """Load lines `colour = word`; empty lines and lines that begin with # are skipped.

    Raises:
        OptionError: when the file cannot be read, has no line, or one does not name a known colour.
    """
    synonyms = {}
    for number, line in _lines(path, "--synonyms"):
        color, _, word = (part.strip() for part in line.partition("="))
        if color not in COLORS or not word:
            raise OptionError(f"{path}, line {number}: write 'colour = word' with one of {', '.join(COLORS)}")
        synonyms[color] = word
    return synonyms


def _lines(path: Path, option: str) -> list[tuple[int, str]]:
    """Read the numbered lines that say something."""
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise OptionError(f"cannot read {option} {path}: {error}") from error
    numbered = [(number, line.strip()) for number, line in enumerate(text.splitlines(), start=1)]
    lines = [(number, line) for number, line in numbered if line and not line.startswith("#")]
    if not lines:
        raise OptionError(f"{option} {path} says nothing: it has only empty lines and comments")
    return lines
