"""Seen, unseen and full variants: the colours that a split may use.

See docs/benchmark.md, "Names and variants" and "Colours".
"""

from __future__ import annotations

from enum import Enum

from sim_bridge.colors import COLORS, SEEN_PALETTE, UNSEEN_PALETTE
from sim_bridge.task_mechanics.task import Split


class Variant(Enum):
    """Variant of a task's colours. seen: the same everywhere; unseen: others in
    validation and test; full: all of them, for training."""

    SEEN = "seen"
    UNSEEN = "unseen"
    FULL = "full"

    def palette(self, split: Split) -> tuple[str, ...]:
        """Return the colours of the things that count."""
        if self is Variant.FULL:
            return tuple(COLORS)
        return UNSEEN_PALETTE if self is Variant.UNSEEN and split is not Split.TRAIN else SEEN_PALETTE
