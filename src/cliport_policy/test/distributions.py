"""Distributions of places that tests of peaks and of fits share."""

import numpy as np


def two_bowls() -> np.ndarray:
    """Masses (3, 160, 80) of two places, one likelier, each at a rotation of its own, with a little elsewhere."""
    mass = np.full((3, 160, 80), 1e-7, np.float32)
    mass[1, 40, 20], mass[0, 40, 21], mass[2, 100, 60], mass[2, 41, 40] = 0.5, 0.1, 0.3, 0.01
    return mass / mass.sum()
