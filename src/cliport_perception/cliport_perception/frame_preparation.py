"""Decoded images on their way to the heightmap: smaller where that is asked for, depth in the colour camera's image."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from cliport_core.errors import ImageError
from cliport_core.pose import Pose
from cliport_perception.camera_model import CameraModel
from cliport_perception.decimation import decimated_camera, decimated_color, decimated_depth
from cliport_perception.registration import DepthRegistration


class PreparedFrame(NamedTuple):
    """Colour (H, W, 3) RGB and depth (H, W) [m] of one camera."""

    color: npt.NDArray[np.uint8]
    depth_m: npt.NDArray[np.float32]
    camera: CameraModel


class FramePreparation:
    """Keeps what the same cameras need again and again. decimation: factor by which images get smaller, 1 or more."""

    def __init__(self, decimation: int = 1) -> None:
        self._factor = decimation
        self._smaller: tuple[CameraModel, CameraModel] | None = None
        self._registration: DepthRegistration | None = None

    def aligned(
        self, color: npt.NDArray[np.uint8], depth_m: npt.NDArray[np.float32], camera: CameraModel
    ) -> PreparedFrame:
        """Return a frame whose depth is in the colour camera's image already.

        Raises:
            CameraModelError: when the images are too small for the factor.
            ImageError: when an image that is to get smaller does not have the camera's size.
        """
        if self._factor == 1:
            return PreparedFrame(color, depth_m, camera)
        _check_size("depth", depth_m, camera)
        return self._with_depth(color, decimated_depth(depth_m, self._factor), camera)

    def unaligned(
        self,
        color: npt.NDArray[np.uint8],
        depth_m: npt.NDArray[np.float32],
        camera: CameraModel,
        depth_camera: CameraModel,
        depth_in_color: Pose,
    ) -> PreparedFrame:
        """Return a frame whose depth comes in the image of another camera.

        depth_in_color: pose of that one's optical frame in the colour camera's.

        Raises:
            CameraModelError: when the images are too small for the factor.
            ImageError: when an image does not have its camera's size.
        """
        smaller = self._camera(camera)
        known = self._registration
        if (
            known is None
            or (known.depth_camera, known.color_camera) != (depth_camera, smaller)
            or not known.depth_in_color.is_close(depth_in_color)
        ):
            known = self._registration = DepthRegistration(depth_camera, smaller, depth_in_color)
        return self._with_depth(color, known.register(depth_m), camera)

    def _with_depth(
        self, color: npt.NDArray[np.uint8], depth_m: npt.NDArray[np.float32], camera: CameraModel
    ) -> PreparedFrame:
        if self._factor == 1:
            return PreparedFrame(color, depth_m, camera)
        _check_size("colour", color, camera)
        return PreparedFrame(decimated_color(color, self._factor), depth_m, self._camera(camera))

    def _camera(self, camera: CameraModel) -> CameraModel:
        if self._factor == 1:
            return camera
        if self._smaller is None or self._smaller[0] != camera:
            self._smaller = camera, decimated_camera(camera, self._factor)
        return self._smaller[1]


def _check_size(what: str, image: npt.NDArray[np.generic], camera: CameraModel) -> None:
    size = (camera.height, camera.width)
    if image.shape[:2] != size:
        raise ImageError(f"{what} image is {image.shape}, the camera model says {size} (rows, columns)")
