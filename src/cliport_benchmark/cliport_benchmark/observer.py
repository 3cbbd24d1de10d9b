"""What a policy sees of a world: one camera frame with the arm at home, as a heightmap."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from cliport_perception import Heightmap, heightmap_from_rgbd
from cliport_perception.clouds import CloudBuilder, cloud_points
from sim_bridge.rendering.appearance import Appearance, random_appearance
from sim_bridge.rendering.camera import CameraConfig, RgbdFrame, SimCamera, mounting_error
from sim_bridge.rendering.image_window import ImageWindow
from sim_bridge.world import SimConfig, SimWorld


class Observer:
    """Takes frames of a world and projects them.

    rng draws the sensor's noise. With `randomize`, each call of `new_scene` draws light, table colour and the
    camera's mounting error; the heightmap is still made with the nominal pose, as calibration would give it.
    Only what sees the workspace is rendered, unless it shall be the `whole_image`, for people to look at.
    """

    def __init__(self, sim: SimConfig, n_threads: int = 0, randomize: bool = False, whole_image: bool = False) -> None:
        self.workspace = sim.workspace
        nominal = CameraConfig()
        window = None
        if not whole_image:
            window = ImageWindow.that_sees(nominal.intrinsics, nominal.camera_in_base, sim.workspace)
        self.camera = SimCamera(CameraConfig(window=window, n_threads=n_threads))
        self._clouds = CloudBuilder(self.camera.intrinsics, self.camera.camera_in_base)
        self._randomize = randomize
        self._appearance: Appearance | None = None
        self._true_camera_in_base = self.camera.camera_in_base
        self._rng = np.random.default_rng(0)

    def new_scene(self, rng: np.random.Generator) -> None:
        """Take the noise of the frames to come from rng, and the scene's look where it is randomized."""
        self._rng = rng
        if self._randomize:
            self._appearance = random_appearance(rng)
            self._true_camera_in_base = mounting_error(self.camera.camera_in_base, rng)

    def frame(self, world: SimWorld) -> RgbdFrame:
        """The camera's frame of the world as it is now."""
        return self.camera.capture(world, self._rng, self._appearance, self._true_camera_in_base)

    def heightmap(self, frame: RgbdFrame) -> Heightmap:
        """A frame seen from straight above."""
        return heightmap_from_rgbd(
            frame.color,
            frame.depth,
            self.camera.intrinsics,
            self.camera.camera_in_base,
            self.workspace,
            round(frame.time * 1e9),
        )

    def cloud(self, frame: RgbdFrame) -> npt.NDArray[np.float32]:
        """Points (H * W, 3) [m] of a frame in the base frame, NaN where nothing was seen."""
        height, width = frame.depth.shape
        return cloud_points(memoryview(self._clouds.build(frame.color, frame.depth)), height, width)

    def observe(self, world: SimWorld) -> Heightmap:
        """Frame and projection in one."""
        return self.heightmap(self.frame(world))
