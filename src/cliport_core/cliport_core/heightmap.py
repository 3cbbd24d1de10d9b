"""The policy's observation: what the camera saw, seen straight from above."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from cliport_core.errors import ImageError
from cliport_core.workspace import WorkspaceSpec


@dataclass(frozen=True, eq=False)
class Heightmap:
    """Orthographic view of the workspace from above.

    color: (rows, cols, 3) uint8 RGB, 0 where invalid.
    height: (rows, cols) float32 [m] above the base frame's origin, 0 where invalid.
    valid: (rows, cols) bool; False where nothing was seen.
    stamp_ns: when the frame was taken [ns].

    Raises:
        ImageError: when shapes or types differ from these.
    """

    color: npt.NDArray[np.uint8]
    height: npt.NDArray[np.float32]
    valid: npt.NDArray[np.bool_]
    workspace: WorkspaceSpec
    stamp_ns: int = 0

    def __post_init__(self) -> None:
        shape = self.workspace.shape
        wanted = (("color", (*shape, 3), np.uint8), ("height", shape, np.float32), ("valid", shape, np.bool_))
        for name, expected_shape, dtype in wanted:
            array = getattr(self, name)
            if array.shape != expected_shape or array.dtype != dtype:
                raise ImageError(
                    f"heightmap {name} must be {expected_shape} {np.dtype(dtype)}, got {array.shape} {array.dtype}"
                )

    @property
    def valid_fraction(self) -> float:
        """Share of the cells that were seen, 0..1."""
        return int(np.count_nonzero(self.valid)) / self.valid.size
