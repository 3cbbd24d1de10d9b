"""Odds of probabilities."""

from __future__ import annotations

import math


def shifted(probability: float, bias: float) -> float:
    """Return a probability whose log odds are changed by a bias."""
    odds = probability * math.exp(bias)
    return odds / (odds + 1.0 - probability)
