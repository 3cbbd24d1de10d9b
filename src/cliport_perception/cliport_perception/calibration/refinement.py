"""Non-linear least squares over the corners' reprojection: every pixel of every sample at once."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.optimize import approx_fprime, least_squares
from scipy.spatial.transform import Rotation

from cliport_core.pose import FloatArray, Pose
from cliport_perception.calibration.initial_guess import Placement
from cliport_perception.calibration.sample import Sample
from cliport_perception.calibration.view import rms_of
from cliport_perception.camera_model import CameraModel

_STEP = 1e-7  # of the numeric derivatives [m or rad]
_NEAREST = 0.01  # a corner this close to the lens, or behind it, is drawn here: the misfit stays finite [m]


@dataclass(frozen=True, eq=False)
class Refined:
    """The best placement and what it leaves.

    scale: size of the printed board over what it should be, 1 where it was not fitted. covariance: (6, 6) of the
    camera's position [m] and of its turn in the base frame [rad]; scale_sigma: standard deviation of the scale.
    """

    placement: Placement
    scale: float
    covariance: FloatArray
    scale_sigma: float


def reprojection_errors(
    samples: Sequence[Sample], placement: Placement, camera: CameraModel, scale: float = 1.0
) -> list[FloatArray]:
    """Return, of each sample, how far its corners (N, 2) are from where a placement draws them, (row, col) [px]."""
    errors = []
    for sample in samples:
        drawn = placement.board_in_camera(sample.gripper_in_base).apply(scale * sample.view.points)
        errors.append(camera.project(_before_lens(drawn)) - sample.view.pixels)
    return errors


def sample_rms(errors: Sequence[FloatArray]) -> FloatArray:
    """Return the root mean square misfit (S,) of each sample [px]."""
    return np.array([rms_of(rows) for rows in errors])


def refine(
    samples: Sequence[Sample], start: Placement, camera: CameraModel, fit_scale: bool = False, robust: bool = False
) -> Refined:
    """Return the placement that draws all corners nearest to where they were seen.

    fit_scale: also fit how large the board was printed. robust: let large misfits count less.
    """
    stacked = _Stacked(samples, start, camera)
    size = 13 if fit_scale else 12
    loss, scale = ("soft_l1", 1.0) if robust else ("linear", 1.0)
    unit = np.full(size, 0.01)
    found = least_squares(stacked.residuals, np.zeros(size), x_scale=unit, loss=loss, f_scale=scale, xtol=1e-12)
    covariance = _jackknife(found.x, stacked.residuals, stacked.sample_of_residual)
    placement = stacked.placement(found.x)
    factor = float(1.0 + found.x[12]) if fit_scale else 1.0
    sigma = float(np.sqrt(covariance[12, 12])) if fit_scale else 0.0
    return Refined(placement, factor, covariance[:6, :6], sigma)


class _Stacked:
    """All samples' corners in arrays, so that a placement's misfit is a few products.

    Parameters: shift [m] and turn [rad] of the camera in the base frame, the same of the board in the gripper's, and
    the board's scale less 1.
    """

    def __init__(self, samples: Sequence[Sample], start: Placement, camera: CameraModel) -> None:
        counts = [len(sample.view.points) for sample in samples]
        index = np.repeat(np.arange(len(samples)), counts)
        self._start = start
        self._camera = camera
        self._points = np.concatenate([sample.view.points for sample in samples])
        self._pixels = np.concatenate([sample.view.pixels for sample in samples])
        self._turns = np.stack([sample.gripper_in_base.rotation for sample in samples])[index]
        self._shifts = np.stack([sample.gripper_in_base.translation for sample in samples])[index]
        self.sample_of_residual = np.repeat(index, 2)

    def placement(self, parameters: FloatArray) -> Placement:
        """Return the placement that parameters (12 or 13,) stand for."""
        return Placement(
            moved(self._start.camera_in_base, parameters[:6]), moved(self._start.board_in_gripper, parameters[6:12])
        )

    def residuals(self, parameters: FloatArray) -> FloatArray:
        """Return the misfit (2 N,) of all corners [px]."""
        placement = self.placement(parameters)
        scale = 1.0 + (parameters[12] if len(parameters) > 12 else 0.0)
        in_gripper = placement.board_in_gripper.apply(scale * self._points)
        in_base = np.einsum("nij,nj->ni", self._turns, in_gripper) + self._shifts
        drawn = placement.camera_in_base.inverse().apply(in_base)
        return (self._camera.project(_before_lens(drawn)) - self._pixels).ravel()


def moved(pose: Pose, change: FloatArray) -> Pose:
    """Return a pose after a change (6,): a shift [m] and a turn about its origin [rad], both in the parent frame."""
    turn = Rotation.from_rotvec(change[3:6]).as_matrix()
    return Pose(turn @ pose.rotation, pose.translation + change[:3])


def fit_pose(residuals: Callable[[Pose], FloatArray], start: Pose, repeats: int = 1) -> tuple[Pose, FloatArray]:
    """Return the one pose with the least squared residuals (M,), and its covariance (6, 6).

    repeats: how often each measurement was repeated with the same error, so that it counts once.
    """

    def of(change: FloatArray) -> FloatArray:
        return residuals(moved(start, change))

    found = least_squares(of, np.zeros(6), x_scale=np.full(6, 0.01), loss="soft_l1", f_scale=1.0, xtol=1e-12)
    slope, errors = approx_fprime(found.x, of, _STEP), of(found.x)
    free = max(1.0, len(errors) / repeats - 6.0)
    variance = float(errors @ errors) / repeats / free
    return moved(start, found.x), repeats * variance * np.linalg.pinv(slope.T @ slope)


def _jackknife(
    at: FloatArray, residuals: Callable[[FloatArray], FloatArray], groups: npt.NDArray[np.intp]
) -> FloatArray:
    """Return the covariance (P, P) of a least-squares solution, from leaving out one sample after the other.

    Each is one Gauss-Newton step away, so that nothing is fitted again. No model of the errors is needed: those of a
    sample may hang together, as they do when the arm is not quite where it says (MacKinnon and White, 1985).
    """
    slope = approx_fprime(at, residuals, _STEP)
    errors = residuals(at)
    normal = slope.T @ slope
    names = np.unique(groups)
    total = np.zeros_like(normal)
    for name in names:
        rows = groups == name
        left = normal - slope[rows].T @ slope[rows]
        change = np.linalg.lstsq(left, slope[rows].T @ errors[rows], rcond=None)[0]
        total += np.outer(change, change)
    return total * (len(names) - 1) / len(names)


def _before_lens(points: FloatArray) -> FloatArray:
    drawn = np.array(points)
    drawn[:, 2] = np.maximum(drawn[:, 2], _NEAREST)
    return drawn
