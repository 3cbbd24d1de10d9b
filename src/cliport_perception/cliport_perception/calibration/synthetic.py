"""Pictures of a board through a lens that distorts, with blur and grain: what tests and `--simulate` look at.

The board's print is sampled along the rays of a finer picture, and averaged: the pixels are those that a sensor would
give, and the detector that reads them is the one that reads real ones.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import cv2
import numpy as np
import numpy.typing as npt

from cliport_core.pose import FloatArray, Pose
from cliport_perception.calibration.board import Board
from cliport_perception.camera_model import CameraModel

_FINE = 3  # rays along each side of a pixel
_PRINT = 3000.0  # of the board's print [pixels/m]


@dataclass(frozen=True)
class PictureConfig:
    """Imperfections of a picture: blur of the lens, standard deviation [px]; grain, of 255; margin: white paper [m]."""

    blur_px: float = 0.6
    grain: float = 3.0
    margin: float = 0.01
    white: float = 205.0
    black: float = 35.0
    background: float = 110.0


class Covered(NamedTuple):
    """A board's paper in a part of a picture, rows and columns, by pixel (h, w).

    share: that the paper covers; ink: the grey that it adds there, of 255; depth: along z [m].
    """

    part: tuple[slice, slice]
    share: FloatArray
    ink: FloatArray
    depth: FloatArray


class SyntheticCamera:
    """Draws one board as one camera sees it. scale: of the print over the board's nominal size."""

    def __init__(
        self, board: Board, camera: CameraModel, config: PictureConfig | None = None, scale: float = 1.0
    ) -> None:
        self.board = board
        self.camera = camera
        self.config = config or PictureConfig()
        self._scale = scale

    def picture(self, board_in_camera: Pose, rng: np.random.Generator) -> npt.NDArray[np.uint8]:
        """Return the grey picture (H, W) of the board at a pose in the optical frame; rng draws its grain."""
        height, width = self.camera.height, self.camera.width
        image = np.full((height, width), self.config.background, dtype=np.float32)
        image += cv2.resize(rng.normal(0.0, 25.0, (9, 16)).astype(np.float32), (width, height))
        covered = self.cover(board_in_camera)
        if covered is not None:
            image[covered.part] = image[covered.part] * (1.0 - covered.share) + covered.ink
        if self.config.blur_px > 0.0:
            image = cv2.GaussianBlur(image, (0, 0), self.config.blur_px)
        image += rng.normal(0.0, self.config.grain, image.shape)
        return np.clip(np.rint(image), 0, 255).astype(np.uint8)

    def cover(self, board_in_camera: Pose) -> Covered | None:
        """Return where the paper lies in the picture, at a pose in the optical frame; None where none of it does."""
        part = self._window(board_in_camera)
        return None if part is None else self._drawn(board_in_camera, part)

    @cached_property
    def _paper(self) -> npt.NDArray[np.float32]:
        print_ = self.board.picture(_PRINT).astype(np.float32) / 255.0
        margin = round(self.config.margin * _PRINT)
        paper = cv2.copyMakeBorder(print_, margin, margin, margin, margin, cv2.BORDER_CONSTANT, value=1.0)
        return np.asarray(self.config.black + paper * (self.config.white - self.config.black), dtype=np.float32)

    def _window(self, pose: Pose) -> tuple[slice, slice] | None:
        """Return the rows and columns of the picture in which the paper lies."""
        margin = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]) * self.config.margin
        corners = pose.apply(self._scale * (self.board.outline + margin))
        if corners[:, 2].min() < 0.05:
            return None
        edge = np.concatenate([np.linspace(corners[i], corners[(i + 1) % 4], 8) for i in range(4)])
        pixels = self.camera.project(edge)
        top, left = np.floor(pixels.min(axis=0)).astype(int).clip(0) - 0
        bottom, right = np.ceil(pixels.max(axis=0)).astype(int) + 1
        bottom, right = min(bottom, self.camera.height), min(right, self.camera.width)
        return (slice(top, bottom), slice(left, right)) if bottom > top and right > left else None

    def _drawn(self, pose: Pose, part: tuple[slice, slice]) -> Covered:
        rows, cols = part
        h, w = rows.stop - rows.start, cols.stop - cols.start
        offset = (np.arange(_FINE) + 0.5) / _FINE - 0.5
        at_row = (np.arange(h)[:, None] + rows.start + offset).ravel().astype(np.float32)
        at_col = (np.arange(w)[:, None] + cols.start + offset).ravel().astype(np.float32)
        u, v = np.meshgrid(at_col, at_row)
        rays = cv2.remap(self.camera.rays(), u, v, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE).astype(np.float64)
        normal = pose.rotation[:, 2]
        depth = float(normal @ pose.translation) / (rays @ normal)
        points = (rays * depth[..., None] - pose.translation) @ pose.rotation / self._scale
        margin = round(self.config.margin * _PRINT)
        x, y = (points[..., i].astype(np.float32) * np.float32(_PRINT) + margin - 0.5 for i in (0, 1))
        fine = cv2.remap(self._paper, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT, borderValue=-1.0)
        is_paper = fine >= self.config.black - 1.0
        share = is_paper.reshape(h, _FINE, w, _FINE).mean(axis=(1, 3))
        ink = np.where(is_paper, fine, 0.0).reshape(h, _FINE, w, _FINE).mean(axis=(1, 3))
        middle = depth[_FINE // 2 :: _FINE, _FINE // 2 :: _FINE]
        return Covered(part, share, ink, middle)
