"""Outlines of what stands out from the table, each turned into a picture of one size."""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

SIDE = 40  # of a picture [pixels]
LEAST_HEIGHT = 0.008  # of what stands out from the table [m]
_LEAST, _MOST = 0.02, 0.11  # across a thing that may be one of the named shapes [m]


class Silhouette(NamedTuple):
    """Thing that stands out from the table.

    cells: (rows, cols) bool, where it is. picture: (SIDE, SIDE) float32 in 0..1, 1 inside the outline; its farthest
    point from the middle is at the picture's border.
    """

    cells: NDArray[np.bool_]
    picture: NDArray[np.float32]


def silhouettes(height: NDArray[np.float32], valid: NDArray[np.bool_], pixel_size: float) -> list[Silhouette]:
    """Return the things that `standing` finds, with their pictures."""
    return [Silhouette(cells, picture_of(cells)) for cells in standing(height, valid, pixel_size)]


def standing(
    height: NDArray[np.float32], valid: NDArray[np.bool_], pixel_size: float, most: float = _MOST
) -> list[NDArray[np.bool_]]:
    """Return where the things on the table are that are as large as a shape to hold, each (rows, cols).

    height: (rows, cols) [m]. valid: (rows, cols), where something was seen. pixel_size: of a cell [m]. most: across the
    largest that are meant [m].
    """
    out = (height > LEAST_HEIGHT) & valid
    count, labels, stats, _ = cv2.connectedComponentsWithStats(out.astype(np.uint8), connectivity=4)
    found = []
    for label in range(1, count):
        across = max(stats[label, cv2.CC_STAT_WIDTH], stats[label, cv2.CC_STAT_HEIGHT]) * pixel_size
        if _LEAST <= across <= most:
            found.append(labels == label)
    return found


def picture_of(cells: NDArray[np.bool_]) -> NDArray[np.float32]:
    """Return the picture (SIDE, SIDE) of a mask (H, W) that holds something."""
    rows, cols = np.nonzero(cells)
    middle = np.array([(cols.min() + cols.max()) / 2, (rows.min() + rows.max()) / 2])
    reach = float(np.hypot(cols - middle[0], rows - middle[1]).max()) + 0.5
    scale = (SIDE / 2 - 1) / reach
    shift = (SIDE - 1) / 2 - scale * middle
    warp = np.array([[scale, 0, shift[0]], [0, scale, shift[1]]])
    picture = cv2.warpAffine(cells.astype(np.float32), warp, (SIDE, SIDE), flags=cv2.INTER_LINEAR)
    return np.asarray(picture, np.float32)
