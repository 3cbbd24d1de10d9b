"""Partition of a container's floor into cells, one for each thing to pack (docs/benchmark.md, "Cut containers")."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from sim_bridge.errors import LayoutError

GAP = 0.01  # between cells, and from the outermost ones to the container's outline [m]

_CUTS = 20  # partitions that are tried for one container
_CONTAINERS = 200  # that are tried


@dataclass(frozen=True)
class Cell:
    """A rectangle of the container's floor: its middle and its edges [m], container frame."""

    x: float
    y: float
    width: float
    depth: float


@dataclass(frozen=True)
class Packing:
    """A container's outer size along x and y [m], and its cells."""

    width: float
    depth: float
    cells: tuple[Cell, ...]


def partition(width: float, depth: float, shortest: float, rng: np.random.Generator) -> tuple[Cell, ...]:
    """Cut the floor of a container of outer size width (x) and depth (y) [m]: as long as a rectangle has a side longer
    than twice `shortest` [m], one such side is cut at a random place that leaves `shortest` on both sides."""
    low, high = (GAP - width / 2, GAP - depth / 2), (width / 2 - GAP, depth / 2 - GAP)
    return tuple(_cells(low, high, shortest, rng))


def random_packing(
    sides: tuple[float, float],
    shortest: float,
    fits: Callable[[Cell], bool],
    rng: np.random.Generator,
) -> Packing:
    """Draw a container with width and depth from `sides` [m], cut so that every cell fits.

    Cuts are drawn again first, then the container too.

    Raises:
        LayoutError: when nothing fitted in a bounded number of draws.
    """
    for _ in range(_CONTAINERS):
        width, depth = (float(side) for side in rng.uniform(*sides, size=2))
        for _ in range(_CUTS):
            cells = partition(width, depth, shortest, rng)
            if all(fits(cell) for cell in cells):
                return Packing(width, depth, cells)
    raise LayoutError(
        f"no cut of {_CONTAINERS} containers with sides of {sides[0]:.2f} to {sides[1]:.2f} m fitted; use other sides"
    )


def _cells(
    low: tuple[float, float], high: tuple[float, float], shortest: float, rng: np.random.Generator
) -> list[Cell]:
    sizes = (high[0] - low[0], high[1] - low[1])
    axes = [axis for axis in (0, 1) if sizes[axis] > 2 * shortest]
    if not axes:
        return [Cell((low[0] + high[0]) / 2, (low[1] + high[1]) / 2, *sizes)]
    axis = axes[int(rng.integers(len(axes)))]
    cut = float(rng.uniform(low[axis] + shortest, high[axis] - shortest))
    before, after = list(high), list(low)
    before[axis], after[axis] = cut - GAP / 2, cut + GAP / 2
    return [
        *_cells(low, (before[0], before[1]), shortest, rng),
        *_cells((after[0], after[1]), high, shortest, rng),
    ]
