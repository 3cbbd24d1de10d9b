"""Best cells of a map of scores, as pixels, and the discs around them that confidences are summed over."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from torch import Tensor
from torch.nn import functional as F

from cliport_core.workspace import WorkspaceSpec

CONFIDENCE_RADIUS = 0.03  # m
_NOTHING = 1e-9  # of a distribution: less than this is no place


class Peak(NamedTuple):
    """Best place of a distribution.

    pixel: (row, col) of the full grid. near: (h, w) bool, the cells within 3 cm.
    """

    pixel: tuple[int, int]
    near: NDArray[np.bool_]

    def confidence(self, mass: NDArray[np.float32]) -> float:
        """Return the share of a distribution over cells, (h, w), that lies in the disc, in [0, 1]."""
        return min(float(mass[self.near].sum()), 1.0)


@dataclass(frozen=True)
class CellGrid:
    """Workspace's pixels grouped to cells of cell_size x cell_size."""

    workspace: WorkspaceSpec
    cell_size: int

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of cells."""
        rows, cols = self.workspace.shape
        return rows // self.cell_size, cols // self.cell_size

    def cell_of(self, pixel: tuple[int, int]) -> tuple[int, int]:
        """Return the cell (row, col) that holds a pixel."""
        return pixel[0] // self.cell_size, pixel[1] // self.cell_size

    def peak(self, mass: NDArray[np.float32]) -> Peak:
        """Return the peak of a distribution over cells (h, w).

        Its pixel is the mean of the best cell's neighbourhood if cells are coarser than pixels.
        """
        row, col = (int(i) for i in np.unravel_index(mass.argmax(), mass.shape))
        cell = self.cell_size
        reach = 1 if cell > 1 else 0
        rows = np.arange(max(row - reach, 0), min(row + reach + 1, mass.shape[0]))
        cols = np.arange(max(col - reach, 0), min(col + reach + 1, mass.shape[1]))
        around = mass[np.ix_(rows, cols)]
        total = float(around.sum())
        mean_row = float((around.sum(1) * rows).sum()) / total
        mean_col = float((around.sum(0) * cols).sum()) / total
        pixel = (
            min(max(round(cell * mean_row + (cell - 1) / 2), 0), self.workspace.rows - 1),
            min(max(round(cell * mean_col + (cell - 1) / 2), 0), self.workspace.cols - 1),
        )
        return Peak(pixel, self.disc((row, col)))

    def peaks(self, mass: NDArray[np.float32], count: int, least: float) -> tuple[Peak, ...]:
        """Return the best places of a distribution over rotations and cells (k, h, w), the best first, 3 cm apart.

        At most count of them, and after the first only such as have a share of at least `least`. No cell is near two.
        """
        left, found = mass.copy(), list[Peak]()
        taken = np.zeros(self.shape, np.bool_)
        while len(found) < count and (not found or float(left.sum()) >= max(least, _NOTHING)):
            pixel, near = self.peak(left[best_rotation(left)])
            peak = Peak(pixel, near & ~taken)
            if found and float(left[:, peak.near].sum()) < least:
                break
            found.append(peak)
            left[:, near], taken[near] = 0.0, True
        return tuple(found)

    def disc(self, cell: tuple[int, int]) -> NDArray[np.bool_]:
        """Return the cells within 3 cm of a cell: (h, w) bool."""
        radius = CONFIDENCE_RADIUS / (self.cell_size * self.workspace.pixel_size)
        rows, cols = np.ogrid[: self.shape[0], : self.shape[1]]
        disc: NDArray[np.bool_] = (rows - cell[0]) ** 2 + (cols - cell[1]) ** 2 <= radius**2
        return disc


def mass_of(logits: Tensor, temperature: float = 1.0) -> NDArray[np.float32]:
    """Return the softmax over all of a tensor, in its shape."""
    mass: NDArray[np.float32] = F.softmax((logits / temperature).flatten(), dim=0).reshape(logits.shape).numpy()
    return mass


def best_rotation(mass: NDArray[np.float32]) -> int:
    """Return the rotation of the likeliest cell of a distribution (k, h, w)."""
    return int(np.unravel_index(mass.argmax(), mass.shape)[0])
