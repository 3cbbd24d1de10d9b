from __future__ import annotations

import numpy as np

from cliport_core.workspace import WorkspaceSpec
from panda_executor.ground_cells import GroundCells, points_near

X, Y, PIXELS = 0.4, -0.1, 8
SPEC = WorkspaceSpec()


def make(points: list[tuple[float, float, float]]) -> GroundCells:
    return GroundCells.around(np.array(points, dtype=np.float32), SPEC, X, Y, PIXELS, (-0.01, 0.2))


def test_each_cell_gets_the_points_above_it() -> None:
    cells = make([(0.0, 0.0, -1.0)])
    assert not cells.seen.any()
    points = [
        (float(cells.x[row, col]), float(cells.y[row, col]), 0.001 * (row * PIXELS + col))
        for row in range(PIXELS)
        for col in range(PIXELS)
    ]
    filled = make(points)
    assert filled.seen.all()
    np.testing.assert_allclose(filled.top.ravel(), 0.001 * np.arange(PIXELS * PIXELS), atol=1e-6)
    assert (filled.x[0, 0], filled.y[0, 0]) == (X - 3.5 * SPEC.pixel_size, Y - 3.5 * SPEC.pixel_size)
    assert filled.cell == SPEC.pixel_size


def test_a_cell_knows_its_highest_point_and_the_mean() -> None:
    x, y = X + SPEC.pixel_size / 2, Y + SPEC.pixel_size / 2
    for heights in ([0.01, 0.03], [0.03, 0.01]):
        cells = make([(x, y, height) for height in heights])
        assert cells.seen.sum() == 1
        assert cells.top[4, 4] == np.float32(0.03)
        assert abs(cells.mean[4, 4] - 0.02) < 1e-6


def test_points_outside_the_heights_or_the_square_are_left_out() -> None:
    half = PIXELS * SPEC.pixel_size / 2
    beyond = half + 1e-4
    left_out = [(X, Y, 0.201), (X, Y, -0.011), (X + beyond, Y, 0.0), (X, Y - beyond, 0.0), (np.nan, Y, 0.0)]
    assert not make(left_out).seen.any()
    near = points_near(np.array([[X, Y, 9.0], [X, Y + beyond, 0.0], [np.nan, Y, 0.0]], np.float32), X, Y, half)
    assert near.tolist() == [True, False, False]


def test_the_central_square_is_in_the_middle() -> None:
    mask = make([(X, Y, 0.0)]).central(4)
    assert mask.sum() == 16 and mask[2:6, 2:6].all()
