"""Image of a perfect camera."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt


@dataclass(frozen=True, eq=False)
class CleanFrame:
    """A noise-free image: color (H, W, 3) uint8 RGB; depth (H, W) float32 [m] along z, inf where nothing is;
    facing (H, W) float32, cosine between view ray and surface normal, 0 where nothing is."""

    color: npt.NDArray[np.uint8]
    depth: npt.NDArray[np.float32]
    facing: npt.NDArray[np.float32]
