"""Angles of rotations."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from cliport_core.pose import Pose


def angle_of(rotations: npt.NDArray[np.float64]) -> Any:
    """Return the angle [rad] of each rotation (..., 3, 3), 0 to pi, exact for small ones too."""
    sine = np.stack(
        [
            rotations[..., 2, 1] - rotations[..., 1, 2],
            rotations[..., 0, 2] - rotations[..., 2, 0],
            rotations[..., 1, 0] - rotations[..., 0, 1],
        ],
        axis=-1,
    )
    return np.arctan2(np.linalg.norm(sine, axis=-1), np.trace(rotations, axis1=-2, axis2=-1) - 1.0)


def pose_difference(first: Pose, second: Pose) -> tuple[float, float]:
    """Return how far two poses in one frame are apart: [mm] and [deg]."""
    shift = float(np.linalg.norm(first.translation - second.translation))
    return 1e3 * shift, float(np.degrees(angle_of(first.rotation.T @ second.rotation)))
