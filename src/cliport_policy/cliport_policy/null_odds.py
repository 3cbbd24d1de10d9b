"""Null actions' probabilities, after what a presence network says."""

from __future__ import annotations

import math

from cliport_policy.odds import shifted
from cliport_policy.presence.presence import KNOWN, Missing

_ABSENT_BIAS = -math.log(3)  # of the log odds of what a presence network says: it is believed from 0.75 on
_FOUND = 0.1  # and where it has a lesser doubt than this,
_FOUND_OUTLINE = 0.5  # or this of an outline, whose name means nothing to the policy, and knows all: heard alone
_NAMED = 0.5  # doubt from which on it names what is missing


def absence(absent: float, missing: Missing | None, done: float) -> tuple[float, str]:
    """Return how likely something named is not to be seen, and what, "" if it can't be told.

    absent: the policy's own. done: how likely the goal is reached, after which outlines need not be seen any more. The
    policy's null action takes scenes in another light for absence, a presence network none.
    """
    if missing is None:
        return absent, ""
    doubt, enough = shifted(missing.probability, _ABSENT_BIAS), _FOUND
    if missing.is_outline:
        doubt, enough = doubt * (1 - done), _FOUND_OUTLINE
    is_found = missing.probability < enough and missing.known > KNOWN
    name = missing.name if missing.probability >= _NAMED else ""
    return (doubt if is_found else max(doubt, absent)), name
