"""Kinds and colours that a presence network knows by number."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from dataclasses import dataclass

from cliport_policy.data.named_things import named_things
from cliport_policy.presence.kinds import listed_kind


@dataclass(frozen=True)
class Vocabulary:
    """Kinds that demonstrations list, and the colours that their sentences name, each sorted."""

    kinds: tuple[str, ...]
    colors: tuple[str, ...]

    @property
    def unknown(self) -> int:
        """Number that stands for any other kind."""
        return len(self.kinds)

    def kind(self, name: str) -> int:
        """Return a kind's number, `unknown` for another."""
        return self.kinds.index(name) if name in self.kinds else self.unknown

    def color(self, name: str) -> int:
        """Return a colour's number from 1 on, 0 for another."""
        return self.colors.index(name) + 1 if name in self.colors else 0


def vocabulary_of(scenes: Iterable[Collection[str]], sentences: Iterable[str]) -> Vocabulary:
    """Return the kinds in scenes that hold things of these names, and the colours in canonical sentences."""
    kinds: set[str] = set()
    for names in scenes:
        kinds.update(listed_kind(name, names) for name in names)
    colors: set[str] = set()
    for sentence in sentences:
        named = named_things(sentence)
        colors |= named.colors() if named else set()
    return Vocabulary(tuple(sorted(kinds)), tuple(sorted(colors)))
