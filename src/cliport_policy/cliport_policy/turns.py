"""Turns: the angle that a distribution over rotations means, finer than its bins."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

_SYMMETRIES = (4, 3, 2)  # times that a thing may look the same in one turn
_ALIKE = 0.6  # length of the mean vector from which on a distribution shows a symmetry
_BESIDE = math.radians(25)  # how far beside the likeliest bin others say something about the same turn


def likeliest_turn(shares: NDArray[np.float32]) -> float:
    """Return the turn [rad] that a distribution (k,) over rotations by i * 2 pi / k means.

    It is the mean of what lies beside the likeliest bin, and beside those in which a thing that looks the same several
    times in a turn would look as it does in that one: a square's four say more than each of them.
    """
    angles = np.arange(len(shares)) * (2 * math.pi / len(shares))
    period = 2 * math.pi
    for times in _SYMMETRIES:
        if abs((shares * np.exp(1j * times * angles)).sum()) >= _ALIKE * shares.sum():
            period /= times
            break
    best = float(angles[shares.argmax()])
    off = np.remainder(angles - best + period / 2, period) - period / 2
    beside = shares * (np.abs(off) <= _BESIDE)
    return best + float((beside * off).sum() / beside.sum())


def split_over(turn: float, n_rotations: int) -> tuple[tuple[int, float], tuple[int, float]]:
    """Return the two rotations between which a turn [rad] lies, each with its share: `likeliest_turn` undoes it."""
    whole, share = divmod(turn / (2 * math.pi / n_rotations), 1)
    return (int(whole) % n_rotations, 1 - share), (int(whole + 1) % n_rotations, share)
