"""A lens from views of a flat board (Zhang, PAMI 22, 2000, as OpenCV has it), with views that it has not seen."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import cv2
import numpy as np

from cliport_core.pose import FloatArray
from cliport_perception.calibration.result import SIGMAS
from cliport_perception.calibration.view import BoardView, fit_view
from cliport_perception.camera_model import CameraModel
from cliport_perception.errors import CalibrationError

_HELD_OUT = 3  # one view of so many
_ODD = 3.0  # times the median of all views' misfits: a view beyond is left out


@dataclass(frozen=True)
class LensLimits:
    """Limits of a lens that may be used.

    min_views: that remain; max_px: root mean square of the held-out views' corners; max_focal: of the focal length's
    uncertainty, as a share of it; max_center: of the principal point's [px].
    """

    min_views: int = 12
    max_px: float = 1.0
    max_focal: float = 0.01
    max_center: float = 5.0


class LensFit(NamedTuple):
    """A lens and how well it is known.

    fitted_px, held_out_px: root mean square of the corners; sigmas: standard deviations of fx, fy, cx and cy [px];
    odd: indices of the views that were left out.
    """

    camera: CameraModel
    fitted_px: float
    held_out_px: float
    sigmas: tuple[float, float, float, float]
    odd: tuple[int, ...]


def solve_lens(views: Sequence[BoardView], size: tuple[int, int], limits: LensLimits | None = None) -> LensFit:
    """Return the lens of pictures of a size (rows, columns) that explains the views best: K and plumb_bob without k3.

    Raises:
        CalibrationError: when there are too few views, or they leave the lens open; naming what is missing.
    """
    limits = limits or LensLimits()
    _check_count(views, limits)
    misfits = _fit(views, size)[2]
    kept = [i for i in range(len(views)) if misfits[i] <= _ODD * float(np.median(misfits))]
    good = [views[i] for i in kept]
    _check_count(good, limits)
    camera, fitted, _, sigmas = _fit(good, size)
    part = _fit([view for i, view in enumerate(good) if i % _HELD_OUT], size)[0]
    seen = [fit_view(view.points, view.pixels, part) for view in good[::_HELD_OUT]]
    squares = [np.inf if view is None else view.rms_px**2 for view in seen]
    held_out = float(np.sqrt(np.mean(squares)))
    _check(camera, held_out, sigmas, limits)
    return LensFit(camera, fitted, held_out, sigmas, tuple(i for i in range(len(views)) if i not in kept))


def _check_count(views: Sequence[BoardView], limits: LensLimits) -> None:
    if len(views) < limits.min_views:
        raise CalibrationError(f"{len(views)} views that agree, at least {limits.min_views} needed: take more")


def _fit(
    views: Sequence[BoardView], size: tuple[int, int]
) -> tuple[CameraModel, float, FloatArray, tuple[float, float, float, float]]:
    """Return the lens, its misfit [px], that of each view (V,) [px], and its standard deviations [px]."""
    rows, cols = size
    points = [view.points.astype(np.float32) for view in views]
    pixels = [np.ascontiguousarray(view.pixels[:, ::-1], dtype=np.float32) for view in views]
    try:
        misfit, k, d, _, _, deviations, _, each = cv2.calibrateCameraExtended(
            points, pixels, (cols, rows), np.eye(3), np.zeros(5), flags=cv2.CALIB_FIX_K3
        )
        bend = tuple(float(v) for v in d.ravel()[:5])
        camera = CameraModel(
            cols, rows, float(k[0, 0]), float(k[1, 1]), float(k[0, 2]), float(k[1, 2]), "plumb_bob", bend
        )
    except (cv2.error, ValueError) as error:
        reason = str(error).splitlines()[0]
        raise CalibrationError(f"these views give no lens ({reason}): tilt the board in other directions") from None
    sigmas = tuple(float(v) for v in deviations.ravel()[:4])
    return (
        camera,
        float(misfit),
        np.asarray(each, dtype=np.float64).ravel(),
        (sigmas[0], sigmas[1], sigmas[2], sigmas[3]),
    )


def _check(camera: CameraModel, held_out: float, sigmas: tuple[float, float, float, float], limits: LensLimits) -> None:
    if not held_out <= limits.max_px:
        raise CalibrationError(
            f"views that were held out are {held_out:.2f} px off, {limits.max_px:g} at most: is the sheet flat, is "
            "--board its form, was the board still?"
        )
    focal = SIGMAS * max(sigmas[0] / camera.fx, sigmas[1] / camera.fy)
    if not focal <= limits.max_focal:
        raise CalibrationError(
            f"the focal length is open by {100 * focal:.1f} %, {100 * limits.max_focal:g} at most: tilt the board "
            "more, by 30 degrees and more, and bring it closer"
        )
    center = SIGMAS * max(sigmas[2:])
    if not center <= limits.max_center:
        raise CalibrationError(
            f"the picture's principal point is open by {center:.1f} px, {limits.max_center:g} at most: tilt the board "
            "about both of its axes, in all parts of the picture"
        )
