"""Ground cells that are drawn by hand: blocks of cells with a height, on a table at 0."""

from __future__ import annotations

import numpy as np

from panda_executor.ground_cells import BoolArray, GroundCells

CELL = 0.0025  # [m]
MIDDLE = 50  # row and column of the cell at (0, 0)


def ground(
    *blocks: tuple[int, int, int, int, float], unseen: tuple[tuple[int, int, int, int], ...] = ()
) -> GroundCells:
    """Return cells (101, 101) about (0, 0) with blocks of (first and last column, first and last row, height [m]).

    Columns and rows count from the middle; unseen: blocks of which nothing was seen.
    """
    top = np.zeros((2 * MIDDLE + 1,) * 2)
    for left, right, low, high, height in blocks:
        top[MIDDLE + low : MIDDLE + high + 1, MIDDLE + left : MIDDLE + right + 1] = height
    for left, right, low, high in unseen:
        top[MIDDLE + low : MIDDLE + high + 1, MIDDLE + left : MIDDLE + right + 1] = np.nan
    at = (np.arange(2 * MIDDLE + 1) - MIDDLE) * CELL
    y, x = np.meshgrid(at, at, indexing="ij")
    return GroundCells(top, top.copy(), ~np.isnan(top), x, y, CELL)


def mask(left: int, right: int, low: int, high: int) -> BoolArray:
    """Return a mask (101, 101) of a block of cells, counted as in `ground`."""
    found = np.zeros((2 * MIDDLE + 1,) * 2, dtype=bool)
    found[MIDDLE + low : MIDDLE + high + 1, MIDDLE + left : MIDDLE + right + 1] = True
    return found
