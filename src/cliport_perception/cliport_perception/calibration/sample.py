"""One sample of a calibration: where the gripper was, and how the camera saw the board in it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from cliport_core.pose import Pose
from cliport_perception.calibration.view import BoardView
from cliport_perception.errors import CalibrationError


@dataclass(frozen=True, eq=False)
class Sample:
    """A view of the board while the gripper stood at a pose in the base frame; stamp_ns: of the picture."""

    gripper_in_base: Pose
    view: BoardView
    stamp_ns: int = 0


@dataclass(frozen=True)
class MotionLimits:
    """Least motion of the samples with which a solution exists.

    min_samples; min_turn: spread of the gripper's orientations about each of two axes, a standard deviation [rad].
    """

    min_samples: int = 10
    min_turn: float = float(np.radians(5.0))


def check_motion(samples: Sequence[Sample], limits: MotionLimits | None = None) -> None:
    """Refuse samples from which no calibration follows: too few, a pure translation, or turns about one axis only.

    Raises:
        CalibrationError: naming what is missing.
    """
    limits = limits or MotionLimits()
    if len(samples) < limits.min_samples:
        raise CalibrationError(f"{len(samples)} samples, at least {limits.min_samples} needed: take more")
    spread = np.degrees(turn_spread([sample.gripper_in_base for sample in samples]))
    least = float(np.degrees(limits.min_turn))
    if spread[0] < least:
        raise CalibrationError(
            f"singular motion: the gripper's orientation varies by {spread[0]:.1f} degrees, at least {least:.0f} "
            "needed: these were shifts only, turn the hand about two axes by 15 degrees or more"
        )
    if spread[1] < least:
        raise CalibrationError(
            f"singular motion: the gripper turned about one axis only ({spread[0]:.1f} degrees, {spread[1]:.1f} about "
            f"others, at least {least:.0f} needed): turn the hand about a second axis by 15 degrees or more"
        )


def turn_spread(poses: Sequence[Pose]) -> np.ndarray:
    """Return the standard deviations (3,) [rad] of orientations along their principal axes, the largest first."""
    turns = Rotation.from_matrix(np.stack([pose.rotation for pose in poses]))
    deviations = (turns.mean().inv() * turns).as_rotvec()
    return np.sqrt(np.linalg.eigvalsh(deviations.T @ deviations / len(poses))[::-1].clip(min=0.0))
