"""Primitive that a training teaches: a network that chooses none has the one of all its demonstrations."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

from cliport_core.action import Primitive
from cliport_policy.data.demonstrations import DemonstrationSet
from cliport_policy.errors import DataError


def primitive_taught(sets: Sequence[DemonstrationSet]) -> Primitive:
    """Return the primitive that all demonstrations have; PICK_PLACE where none of them acts.

    Raises:
        DataError: when they have different ones, naming data sets and counts.
    """
    counts = [_actions_by_primitive(data) for data in sets]
    primitives = {primitive for count in counts for primitive in count}
    if len(primitives) > 1:
        found = "; ".join(f"{data.folder} holds {_words(count)}" for data, count in zip(sets, counts, strict=True))
        raise DataError(
            f"a network acts with one primitive, and the demonstrations have {len(primitives)} ({found}): "
            "make a data set of each and train a network on each"
        )
    return primitives.pop() if primitives else Primitive.PICK_PLACE


def check_primitive(sets: Sequence[DemonstrationSet], known: Primitive, checkpoint: str) -> None:
    """Raise DataError, naming data sets and counts, where a demonstration is not of the checkpoint's primitive."""
    for data in sets:
        count = _actions_by_primitive(data)
        if set(count) - {known}:
            raise DataError(
                f"{data.folder} holds {_words(count)}, and the checkpoint {checkpoint} acts with {known.label} only: "
                f"go on with demonstrations of {known.label}, or train on these without --init"
            )


def _actions_by_primitive(data: DemonstrationSet) -> Counter[Primitive]:
    """How many demonstrations there are of each; that nothing remains to be done is none."""
    return Counter(demo.primitive for frame in data.frames for demo in frame.demos if not demo.done)


def _words(count: Counter[Primitive]) -> str:
    if not count:
        return "no demonstration of an action"
    each = " and ".join(f"{count[primitive]} of {primitive.label}" for primitive in sorted(count))
    return each.replace(" of ", " demonstrations of ", 1)
