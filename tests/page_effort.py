"""What a step takes somebody at the page."""

from __future__ import annotations

import statistics
from collections.abc import Sequence
from typing import NamedTuple


class Effort(NamedTuple):
    """What a step took: pointer actions, seconds until the arm began, seconds to its end."""

    actions: int
    drawing: float
    whole: float


def effort_words(efforts: Sequence[Effort]) -> str:
    """Return the medians over all steps."""
    if not efforts:
        return "no step was carried through"
    actions, drawing, whole = (statistics.median(values) for values in zip(*efforts, strict=True))
    return (
        f"median of {len(efforts)} steps: {actions:g} pointer actions, {drawing:.1f} s until the arm begins, "
        f"{whole:.1f} s with its motion"
    )
