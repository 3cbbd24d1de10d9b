"""The peak of a map of scores as a pixel: at the borders, and between cells that are coarser than pixels."""

from __future__ import annotations

import numpy as np
import pytest
from distributions import two_bowls

from cliport_core.workspace import WorkspaceSpec
from cliport_policy.peaks import CellGrid

WORKSPACE = WorkspaceSpec()
LAST_ROW, LAST_COL = WORKSPACE.rows - 1, WORKSPACE.cols - 1


@pytest.mark.parametrize("pixel", [(0, 0), (0, LAST_COL), (LAST_ROW, 0), (LAST_ROW, LAST_COL), (7, 11)])
def test_a_pixel_is_its_own_peak_up_to_the_border(pixel: tuple[int, int]) -> None:
    mass = np.zeros(WORKSPACE.shape, np.float32)
    mass[pixel] = 1.0
    mass[3, 12] = 0.5  # what lies beside it does not move it
    peak = CellGrid(WORKSPACE, 1).peak(mass)
    assert peak.pixel == pixel
    assert peak.near[pixel]
    assert peak.confidence(mass) >= 1.0


def test_the_peak_of_coarse_cells_lies_between_them() -> None:
    grid = CellGrid(WORKSPACE, 4)
    mass = np.zeros(grid.shape, np.float32)
    mass[10, 5], mass[10, 6] = 0.6, 0.4
    mass[20, 20] = mass[10, 7] = mass[12, 5] = 0.1  # too far away to count
    row, col = grid.peak(mass).pixel
    assert row == pytest.approx(4 * 10 + 1.5, abs=0.5)
    assert col == pytest.approx(4 * 5.4 + 1.5, abs=0.5)


def test_the_middle_of_a_corner_cell_is_the_peak_where_nothing_is_beside_it() -> None:
    grid = CellGrid(WORKSPACE, 4)
    for cell in ((0, 0), (grid.shape[0] - 1, grid.shape[1] - 1)):
        mass = np.zeros(grid.shape, np.float32)
        mass[cell] = 1.0
        pixel = grid.peak(mass).pixel
        assert grid.cell_of(pixel) == cell
        assert pixel == (4 * cell[0] + 2, 4 * cell[1] + 2)


def test_the_best_places_come_in_order_and_lie_apart() -> None:
    grid, mass = CellGrid(WORKSPACE, 2), two_bowls()
    first, second = grid.peaks(mass, 4, 0.02)
    assert grid.cell_of(first.pixel) == (40, 20) and grid.cell_of(second.pixel) == (100, 60)
    assert first.near[40, 21] and not (first.near & second.near).any()
    assert [grid.cell_of(peak.pixel) for peak in grid.peaks(mass, 3, 0.001)][2] == (41, 40)
    assert len(grid.peaks(mass, 1, 0.02)) == 1
    sharp = np.zeros_like(mass)
    sharp[1, 4, 4] = 1.0
    assert len(grid.peaks(sharp, 4, 0.02)) == len(grid.peaks(sharp, 4, 0.0)) == 1
    mass[:, 47, 20] = 0.4  # 3.5 cm from the first: their discs would overlap
    close = grid.peaks(mass / mass.sum(), 2, 0.02)
    assert not (close[0].near & close[1].near).any() and close[1].near.sum() < close[0].near.sum()
