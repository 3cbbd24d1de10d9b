"""The cells of a packing container: gaps, sizes, how many, and cuts that cannot fit."""

import itertools

import numpy as np
import pytest

from sim_bridge.errors import LayoutError
from sim_bridge.tasks.box_partition import GAP, Cell, partition, random_packing


def edges(cell: Cell) -> tuple[float, float, float, float]:
    return (
        cell.x - cell.width / 2, cell.x + cell.width / 2, cell.y - cell.depth / 2, cell.y + cell.depth / 2
    )  # fmt: skip


def test_cells_keep_their_gaps_and_fill_the_container() -> None:
    rng = np.random.default_rng(0)
    for _ in range(50):
        width, depth = rng.uniform(0.05, 0.30, size=2)
        cells = partition(width, depth, 0.05, rng)
        for cell in cells:
            low_x, high_x, low_y, high_y = edges(cell)
            assert low_x > GAP - width / 2 - 1e-9 and high_x < width / 2 - GAP + 1e-9
            assert low_y > GAP - depth / 2 - 1e-9 and high_y < depth / 2 - GAP + 1e-9
            assert min(cell.width, cell.depth) > 0.03 - 1e-9 and max(cell.width, cell.depth) < 0.10 + 1e-9
        for a, b in itertools.combinations(cells, 2):
            apart_x = max(edges(a)[0] - edges(b)[1], edges(b)[0] - edges(a)[1])
            apart_y = max(edges(a)[2] - edges(b)[3], edges(b)[2] - edges(a)[3])
            assert max(apart_x, apart_y) > GAP - 1e-9
        # every cut takes its gap along the whole cut; what is left belongs to the cells
        area = sum(cell.width * cell.depth for cell in cells)
        assert area > -1e-9 + (width - 2 * GAP) * (depth - 2 * GAP) - (len(cells) - 1) * GAP * 0.3


@pytest.mark.parametrize(
    ("sides", "shortest", "mean", "counts"),
    [((0.05, 0.30), 0.05, 5.16, range(1, 21)), ((0.20, 0.35), 0.08, 5.51, range(4, 10))],
)
def test_how_many_cells_there_are(sides: tuple[float, float], shortest: float, mean: float, counts: range) -> None:
    rng = np.random.default_rng(1)
    drawn = [len(partition(*rng.uniform(*sides, size=2), shortest, rng)) for _ in range(3000)]
    assert np.mean(drawn) == pytest.approx(mean, abs=0.2)
    assert set(drawn) <= set(counts)


def test_cuts_are_drawn_again_until_every_cell_fits() -> None:
    rng = np.random.default_rng(2)
    for _ in range(30):
        packing = random_packing((0.05, 0.30), 0.05, lambda cell: min(cell.width, cell.depth) <= 0.072, rng)
        assert all(min(cell.width, cell.depth) <= 0.072 for cell in packing.cells)
        assert 0.05 <= packing.width <= 0.30 and 0.05 <= packing.depth <= 0.30


def test_what_never_fits_ends_in_an_error() -> None:
    with pytest.raises(LayoutError, match=r"no cut of .* containers .* fitted"):
        random_packing((0.2, 0.3), 0.05, lambda cell: False, np.random.default_rng(3))
