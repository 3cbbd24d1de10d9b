"""Samples that do not fit: whether they agree among themselves, because the camera or the board moved meanwhile."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from cliport_core.pose import FloatArray, Pose
from cliport_perception.calibration.angles import pose_difference
from cliport_perception.calibration.initial_guess import Placement
from cliport_perception.calibration.refinement import fit_pose, reprojection_errors, sample_rms
from cliport_perception.calibration.sample import Sample
from cliport_perception.camera_model import CameraModel
from cliport_perception.errors import CalibrationError

_LEAST = 3  # samples that must agree: two may do so by chance
_AGREE = 0.7  # share of the odd samples that must
_AGREE_PX = 1.5


def explain_odd_samples(
    samples: Sequence[Sample], odd: list[int], kept: list[int], placement: Placement, camera: CameraModel
) -> None:
    """Refuse samples that fall into two groups, each at peace with itself; odd, kept: indices in the order of taking.

    Raises:
        CalibrationError: saying whether the camera or the board moved, after which sample and how far.
    """
    if len(odd) < _LEAST:
        return
    group = [samples[i] for i in odd]

    def with_camera(pose: Pose) -> Placement:
        return Placement(pose, placement.board_in_gripper)

    def with_board(pose: Pose) -> Placement:
        return Placement(placement.camera_in_base, pose)

    camera_pose, held = placement.camera_in_base, placement.board_in_gripper
    found = [
        ("camera", camera_pose, *_fitted(group, with_camera, camera_pose, camera)),
        ("board in the gripper", held, *_fitted(group, with_board, held, camera)),
    ]
    what, before, after, agreeing = max(found, key=lambda row: row[3])
    if agreeing < max(_LEAST, _AGREE * len(odd)):
        return
    mm, deg = pose_difference(before, after)
    raise CalibrationError(
        f"the {what} moved by {mm:.0f} mm and {deg:.1f} degrees while samples were taken, near sample "
        f"{_change(odd, kept)}: fix it firmly and begin again"
    )


def _fitted(
    group: Sequence[Sample], placed: Callable[[Pose], Placement], start: Pose, camera: CameraModel
) -> tuple[Pose, int]:
    """Return the pose that most of a group agree on, and how many do."""

    def residuals(pose: Pose) -> FloatArray:
        return np.concatenate(reprojection_errors(group, placed(pose), camera)).ravel()

    pose, _ = fit_pose(residuals, start)
    rms = sample_rms(reprojection_errors(group, placed(pose), camera))
    return pose, int(np.count_nonzero(rms < _AGREE_PX))


def _change(odd: list[int], kept: list[int]) -> int:
    """Return the number, from 1, of the sample after which things changed: where the two groups divide best."""
    marks = np.zeros(len(odd) + len(kept))
    marks[odd] = 1.0
    below = np.cumsum(marks)[:-1]
    sizes = np.arange(1, len(marks))
    apart = np.abs(below / sizes - (below[-1] + marks[-1] - below) / (len(marks) - sizes))
    return int(np.argmax(apart)) + 1
