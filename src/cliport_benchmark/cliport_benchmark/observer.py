"""A policy's view of a world: one camera frame with the arm at home, as a heightmap."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from cliport_benchmark.variation import Aspect, SceneLook, Variation
from cliport_core import Heightmap
from cliport_perception import heightmap_from_rgbd
from cliport_perception.camera_file import CameraCalibration
from cliport_perception.clouds import CloudBuilder, CloudRegion
from sim_bridge.rendering.camera import CameraConfig, RgbdFrame, SimCamera
from sim_bridge.rendering.image_window import ImageWindow
from sim_bridge.rendering.mounting import load_camera
from sim_bridge.rendering.sensor_noise import NoiseConfig, SensorKind
from sim_bridge.world import SimConfig, SimWorld

_BORDER = 12  # around the workspace's view, rendered too [pixels]
_MOUNTING_SIGMAS = 4.0  # size of a mounting error that the border covers


class Observer:
    """Takes frames of a world and projects them.

    rng draws the sensor's noise. Each call of `new_scene` draws what varies of the look; where the camera is not
    where calibration says, the heightmap is still made with the pose that calibration would give.
    Only what sees the workspace is rendered, unless it shall be the `whole_image`, for people to look at.
    """

    def __init__(
        self,
        sim: SimConfig,
        n_threads: int = 0,
        variation: Variation | None = None,
        whole_image: bool = False,
        camera: CameraCalibration | None = None,
        camera_kind: SensorKind = SensorKind.PLAIN,
    ) -> None:
        """Make the camera: lens, image size and calibrated pose, the simulator's own by default, and how it errs."""
        self.workspace = sim.workspace
        nominal = camera or load_camera()
        self._variation = variation or Variation()
        window = None
        if not whole_image:
            border = _border(nominal, self._variation)
            window = ImageWindow.around_workspace(
                nominal.intrinsics, nominal.camera_in_base, sim.workspace, border=border
            )
        self.camera = SimCamera(
            CameraConfig(
                nominal.intrinsics,
                nominal.camera_in_base,
                noise=NoiseConfig.of_kind(camera_kind),
                window=window,
                n_threads=n_threads,
            )
        )
        region = CloudRegion.around(sim.workspace)
        self._clouds = CloudBuilder(self.camera.intrinsics, self.camera.camera_in_base, region)
        self._look = SceneLook(self.camera.config.appearance, self.camera.camera_in_base)
        self._rng = np.random.default_rng(0)

    def new_scene(self, rng: np.random.Generator) -> None:
        """Take the noise of the frames to come from rng, and what varies of the scene's look from its children."""
        self._rng = rng
        self._look = self._variation.scene_look(self.camera.config.appearance, self.camera.camera_in_base, rng)

    def frame(self, world: SimWorld) -> RgbdFrame:
        """Take the camera's frame of the world as it is now."""
        return self.camera.capture(world, self._rng, self._look.appearance, self._look.true_camera_in_base)

    def heightmap(self, frame: RgbdFrame) -> Heightmap:
        """Convert a frame to a view from straight above."""
        return heightmap_from_rgbd(
            frame.color,
            frame.depth,
            self.camera.intrinsics,
            self.camera.camera_in_base,
            self.workspace,
            round(frame.time * 1e9),
        )

    def cloud(self, frame: RgbdFrame) -> npt.NDArray[np.float32]:
        """Return the points (N, 3) [m] of a frame in the base frame, over and around the workspace."""
        return self._clouds.points(frame.depth)

    def observe(self, world: SimWorld) -> Heightmap:
        """Take a frame and convert it to a heightmap."""
        return self.heightmap(self.frame(world))


def _border(camera: CameraCalibration, variation: Variation) -> int:
    """Return the pixels around the workspace's view that keep it in view where the camera is shifted and turned."""
    if Aspect.MOUNTING not in variation.aspects:
        return _BORDER
    errors, lens = variation.mounting, camera.intrinsics
    distance = max(float(camera.camera_in_base.translation[2]), 0.1)  # [m], at the least that of the camera's foot
    return max(_BORDER, math.ceil(_MOUNTING_SIGMAS * max(lens.fx, lens.fy) * (errors.turn + errors.shift / distance)))
