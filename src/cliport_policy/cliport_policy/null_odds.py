"""Null actions' probabilities, after what was fitted to them, and after what a presence network says."""

from __future__ import annotations

import math

from cliport_policy.presence.presence import Missing

_ABSENT_BIAS = -math.log(3)  # of the log odds of what a presence network says: it is believed from 0.75 on
_FOUND = 0.1  # and where it has a lesser doubt than this,
_KNOWN = 0.9  # and is as sure that it knows all that is named, it alone is heard
_NAMED = 0.5  # doubt from which on it names what is missing


def shifted(probability: float, bias: float) -> float:
    """Return a probability whose log odds are changed by a bias."""
    odds = probability * math.exp(bias)
    return odds / (odds + 1.0 - probability)


def absence(probability: float, missing: Missing | None) -> tuple[float, str]:
    """Return how likely something named is not to be seen, and what, "" if it can't be told.

    probability: the policy's own. Its null action takes scenes in another light for absence, a presence network none.
    """
    if missing is None:
        return probability, ""
    doubt = shifted(missing.probability, _ABSENT_BIAS)
    is_found = missing.probability < _FOUND and missing.known > _KNOWN
    name = missing.name if missing.probability >= _NAMED else ""
    return (doubt if is_found else max(doubt, probability)), name
