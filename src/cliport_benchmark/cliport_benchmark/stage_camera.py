"""The view in which people are shown a scene: from the camera's side, oblique, sharp and without noise."""

from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt

from cliport_core import Pose
from cliport_perception import CameraModel
from sim_bridge.rendering.camera import CameraConfig, SimCamera
from sim_bridge.rendering.sensor_noise import NoiseConfig
from sim_bridge.world import SimWorld

_EYE, _TARGET = (1.18, 0.22, 0.80), (0.468, 0.0, 0.01)  # base frame [m]
_FOCAL = 1.1  # focal length as a share of the picture's width
_MIDDLE = 9 / 32  # the target's height above the picture's lower edge, likewise


class StageCamera:
    """Takes pictures (height, width, 3) RGB of a world; the higher they are, the more of the arm they show.

    finer: rays per pixel and axis, for smooth edges.
    """

    def __init__(self, width: int, height: int, finer: int = 1) -> None:
        self._size = (width, height)
        w, h = width * finer, height * finer
        model = CameraModel(w, h, _FOCAL * w, _FOCAL * w, w / 2, h - _MIDDLE * w)
        self._camera = SimCamera(
            CameraConfig(intrinsics=model, camera_in_base=Pose.looking_at(_EYE, _TARGET), noise=NoiseConfig.none())
        )
        self._rng = np.random.default_rng(0)  # nothing is drawn from it: there is no noise

    def picture(self, world: SimWorld) -> npt.NDArray[np.uint8]:
        """Take a picture of the world as it is now."""
        color = self._camera.capture(world, self._rng).color
        return np.asarray(cv2.resize(color, self._size, interpolation=cv2.INTER_AREA), dtype=np.uint8)
