"""A watch over what lies around the workspace: where all of the picture has moved as one, the camera has.

It sees what the table's plane does not: a shift along the table, and a turn about its normal.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import cv2
import numpy as np
import numpy.typing as npt

from cliport_core.pose import Pose
from cliport_core.workspace import WorkspaceSpec
from cliport_perception.camera_model import CameraModel

MAX_MOTION = 0.002  # of the picture's width: 2 of 960 pixels, some 4 mm at 1 m
_WIDTH = 320  # of the pictures that are compared [pixels]
_PERIOD_NS = 900_000_000  # from one look to the next
_PATIENCE = 2  # looks in a row at a camera that has moved
_MARGIN, _TALLEST = 0.06, 0.15  # so far around the workspace, and so high over it, pictures change [m]
_ALIGNED = 0.98  # least correlation of two pictures that one motion makes the same
_COARSELY, _COARSELY_ALIGNED = 4, 0.95  # so much smaller pictures say first whether one motion is worth looking for
_MOST_LEFT = 0.6  # of what differed, at most so much may be left
_TILE = 10  # edge of the tiles that a camera's motion must explain one by one, as an arm's does not [pixels]
# Least share of the tiles in which a motion is to be seen that it explains, by its size as a share of the picture's
# width: what stands nearer to the camera, as an arm, moves otherwise, which tells most where the rest hardly moved.
_LEAST_EXPLAINED = ((0.0, 0.012), (0.45, 0.75))
_SEEN = 5.0  # times the noise by which a tile's pixels are changed by a motion that is to be seen in it
_STILL = 0.001  # at most so far below 1 is the correlation of pictures that are not looked into any further
_LEAST_CONTRAST = 4.0  # standard deviation of the surroundings' grey, of 255: with less there is nothing to follow
_LEAST_SHARE = 0.1  # of the picture that shows surroundings
_MOST_VIEWS = 4  # that are remembered: the arm may stand in the picture in several places
_REMEDY = "put it back, or calibrate again and restart perception"

FloatImage = npt.NDArray[np.float32]


class _Motion(NamedTuple):
    """The correlation of two pictures after an affine motion, and that, (2, 3)."""

    aligned: float
    warp: npt.NDArray[np.float32]


class SurroundingsWatch:
    """Compares the picture around the workspace with views of it from before; camera: at one pose."""

    def __init__(
        self, camera: CameraModel, camera_in_base: Pose, workspace: WorkspaceSpec, max_motion: float = MAX_MOTION
    ) -> None:
        """Begin without a view. max_motion: of the picture, as a share of its width."""
        self._size = (_WIDTH, max(1, round(camera.height * _WIDTH / camera.width)))
        around = ~_over_workspace(camera, camera_in_base, workspace)
        self._mask = cv2.resize(around.astype(np.uint8), self._size, interpolation=cv2.INTER_NEAREST)
        self._coarse_mask = _coarse(self._mask, cv2.INTER_NEAREST)
        self._max_motion = max_motion
        self._views: list[FloatImage] = []
        self._last: FloatImage | None = None
        self._looked_ns: int | None = None
        self._beyond = 0
        self._noise = 0.0  # by which the correlation of two pictures of one view is below 1
        self._words: str | None = None

    def check(self, color: npt.NDArray[np.uint8], stamp_ns: int) -> str | None:
        """Note a picture (H, W, 3) RGB, about one a second; return why it must not be acted on, or None."""
        if self._looked_ns is None or not 0 <= stamp_ns - self._looked_ns < _PERIOD_NS:
            self._looked_ns = stamp_ns
            self._look(self._prepared(color))
        return self._words

    def _prepared(self, color: npt.NDArray[np.uint8]) -> FloatImage:
        small = cv2.resize(color, self._size, interpolation=cv2.INTER_AREA)
        gray = cv2.GaussianBlur(cv2.cvtColor(small, cv2.COLOR_RGB2GRAY), (3, 3), 0.8)
        return np.asarray(gray, dtype=np.float32)

    def _look(self, picture: FloatImage) -> None:
        around = picture[self._mask > 0]
        if around.size < _LEAST_SHARE * picture.size or around.std() < _LEAST_CONTRAST:
            return
        motions = [motion for view in self._views if (motion := self._motion(view, picture)) is not None]
        moved = max(motions, default=0.0) > self._max_motion
        self._beyond = self._beyond + 1 if moved else 0
        if moved:
            pixels = 100.0 * max(motions)
            words = f"the camera was moved: all that it sees around the workspace lies {pixels:.1f} % of the picture's"
            self._words = f"{words} width off where it lay; {_REMEDY}" if self._beyond >= _PATIENCE else self._words
        elif motions:
            self._words = None
        elif self._words is None and self._is_still(picture):
            self._views = [*self._views[: _MOST_VIEWS - 1], picture]
        self._last = picture

    def _is_still(self, picture: FloatImage) -> bool:
        if self._last is None:
            return not self._views
        motion = self._motion(self._last, picture)
        return motion is not None and motion <= self._max_motion

    def _motion(self, before: FloatImage, now: FloatImage) -> float | None:
        """Return how far the surroundings have moved as one, a share of the width; None: something else has changed."""
        apart = 1.0 - _correlation(before, now, self._mask)
        if apart <= min(2.0 * self._noise, _STILL):
            return 0.0
        coarsely = _best_motion(_coarse(before), _coarse(now), self._coarse_mask, 1)
        if coarsely is None or coarsely.aligned < _COARSELY_ALIGNED:
            return None
        best = _best_motion(before, now, self._mask, 5)
        if best is None:
            return None
        aligned, warp = best
        row, col = np.nonzero(self._mask)
        shift = np.stack([col, row, np.ones_like(col)]).T @ warp.T - np.stack([col, row]).T
        motion = float(np.hypot(*shift.T).mean()) / _WIDTH
        if motion <= self._max_motion:
            self._noise = min(self._noise or apart, apart)
        if aligned < _ALIGNED:
            return None
        explained = motion <= self._max_motion or (
            1.0 - aligned <= _MOST_LEFT * apart and self._is_all_explained(before, now, warp, motion)
        )
        return motion if explained else None

    def _is_all_explained(
        self, before: FloatImage, now: FloatImage, warp: npt.NDArray[np.float32], motion: float
    ) -> bool:
        """Return True if the motion makes the pictures alike nearly everywhere that it would be seen.

        An arm is often most of what differs: a motion that fits it moves the rest from where that stands still.
        """
        flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
        back = cv2.warpAffine(now, warp, self._size, flags=flags, borderMode=cv2.BORDER_REPLICATE)
        shown = self._mask * cv2.warpAffine(self._mask, warp, self._size, flags=flags)  # beyond the border lies 0
        one, other, moved = (_standardized(picture, self._mask) for picture in (before, now, back))
        apart, left, change = (_by_tile(a - b, shown) for a, b in ((one, other), (one, moved), (other, moved)))
        seen = change >= _SEEN * np.percentile(np.minimum(apart, left), 25)
        least = float(np.interp(motion, *_LEAST_EXPLAINED))
        return bool(seen.any()) and float((left < 0.5 * apart)[seen].mean()) >= least


def _over_workspace(camera: CameraModel, camera_in_base: Pose, workspace: WorkspaceSpec) -> npt.NDArray[np.bool_]:
    """Return the pixels (H, W) that may show what lies on the workspace."""
    rays = camera.rays().astype(np.float64) @ camera_in_base.rotation.T
    covered = np.zeros(rays.shape[:2], dtype=np.bool_)
    for height in (workspace.z_min, _TALLEST):
        with np.errstate(divide="ignore", invalid="ignore"):
            reach = (height - camera_in_base.translation[2]) / rays[..., 2]
            covered |= workspace.contains(rays * reach[..., None] + camera_in_base.translation, -_MARGIN) & (reach > 0)
    return covered


def _standardized(picture: FloatImage, mask: npt.NDArray[np.uint8]) -> FloatImage:
    around = picture[mask > 0]
    return np.asarray((picture - around.mean()) / max(float(around.std()), 1e-6), dtype=np.float32)


def _coarse(image: npt.NDArray[Any], how: int = cv2.INTER_AREA) -> npt.NDArray[Any]:
    size = (image.shape[1] // _COARSELY, max(1, image.shape[0] // _COARSELY))
    return np.asarray(cv2.resize(image, size, interpolation=how))


def _best_motion(before: FloatImage, now: FloatImage, mask: npt.NDArray[np.uint8], blur: int) -> _Motion | None:
    """Return the motion that makes pictures most alike where mask is not 0; None if the search does not converge.

    blur: width of the filter that both get before [pixels].
    """
    start, stop = np.eye(2, 3, dtype=np.float32), (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 30, 1e-4)
    try:
        return _Motion(*cv2.findTransformECC(before, now, start, cv2.MOTION_AFFINE, stop, mask, blur))
    except cv2.error:
        return None


def _by_tile(difference: FloatImage, shown: npt.NDArray[np.uint8]) -> npt.NDArray[np.float32]:
    """Return the mean squared difference of each tile of which at least a quarter is shown, (tiles,)."""
    size = (difference.shape[1] // _TILE, difference.shape[0] // _TILE)
    cut = np.s_[: size[1] * _TILE, : size[0] * _TILE]
    share = cv2.resize(shown[cut].astype(np.float32), size, interpolation=cv2.INTER_AREA)
    error = cv2.resize((difference**2 * shown)[cut], size, interpolation=cv2.INTER_AREA)
    return np.asarray((error / np.maximum(share, 1e-6))[share >= 0.25], dtype=np.float32)


def _correlation(one: FloatImage, other: FloatImage, mask: npt.NDArray[np.uint8]) -> float:
    a, b = (picture[mask > 0].astype(np.float64) for picture in (one, other))
    a, b = a - a.mean(), b - b.mean()
    size = float(np.sqrt((a @ a) * (b @ b)))
    return float(a @ b) / size if size > 0.0 else 0.0
