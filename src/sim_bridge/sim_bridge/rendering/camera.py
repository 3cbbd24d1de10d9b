"""The simulated RGB-D camera: like a Kinect-2 on a tripod opposite the robot, with its imperfections."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from cliport_core import Pose
from cliport_perception import CameraModel
from cliport_perception.calibration.board import Board
from sim_bridge.rendering.appearance import Appearance
from sim_bridge.rendering.clean_frame import CleanFrame
from sim_bridge.rendering.held_board import HeldBoard
from sim_bridge.rendering.image_window import ImageWindow
from sim_bridge.rendering.mounting import load_camera, load_mounting
from sim_bridge.rendering.renderer import Renderer
from sim_bridge.rendering.sensor_noise import NoiseConfig, with_noise
from sim_bridge.rendering.visible import Visible
from sim_bridge.robot import HAND, ROBOT

OPTICAL_FRAME = "camera_color_optical_frame"
_STILL_TOLERANCE = 2e-4  # a pose's numbers [m, or of a rotation matrix] change less than this while nothing moves


def default_intrinsics() -> CameraModel:
    """Return the shipped camera's image size and lens (`rendering/mounting.yaml`)."""
    return load_camera().intrinsics


@dataclass(frozen=True)
class CameraConfig:
    """Intrinsics, pose of the optical frame (z forward) in the base frame, noise and light."""

    intrinsics: CameraModel = field(default_factory=default_intrinsics)
    camera_in_base: Pose = field(default_factory=load_mounting)
    noise: NoiseConfig = field(default_factory=NoiseConfig)
    appearance: Appearance = field(default_factory=Appearance)
    window: ImageWindow | None = None  # the part that is rendered, the rest stays empty; None: all
    n_threads: int = 0  # 0: every core
    held_board: Board | None = None  # fixed to the hand, to calibrate with
    reuse_still: bool = False  # render again only when something has moved; the noise is fresh all the same


@dataclass(frozen=True, eq=False)
class RgbdFrame:
    """color (H, W, 3) uint8 RGB; depth (H, W) float32 [m] along z, NaN where unknown; simulated time [s]."""

    color: npt.NDArray[np.uint8]
    depth: npt.NDArray[np.float32]
    time: float


class SimCamera:
    """Takes noisy RGB-D frames of a world."""

    def __init__(self, config: CameraConfig | None = None) -> None:
        self.config = config or CameraConfig()
        self._window = self.config.window or ImageWindow.whole(self.config.intrinsics)
        self._renderer = Renderer(self.config.intrinsics, self._window, self.config.n_threads)
        board = self.config.held_board
        self._held = HeldBoard(board, HAND, self.config.intrinsics, self._window) if board is not None else None
        self._last: tuple[object, npt.NDArray[np.float64], CleanFrame] | None = None

    @property
    def intrinsics(self) -> CameraModel:
        """The camera's model."""
        return self.config.intrinsics

    @property
    def camera_in_base(self) -> Pose:
        """Pose of the optical frame according to calibration."""
        return self.config.camera_in_base

    def capture(
        self,
        world: Visible,
        rng: np.random.Generator,
        appearance: Appearance | None = None,
        true_camera_in_base: Pose | None = None,
    ) -> RgbdFrame:
        """Take a frame of the world as it is now; rng draws the noise.

        appearance, true_camera_in_base: light and true mounting of this frame; as configured by default.
        """
        clean = self._clean(world, true_camera_in_base or self.camera_in_base, appearance or self.config.appearance)
        color, depth = with_noise(clean, self.config.noise, rng)
        return RgbdFrame(*self._in_full_frame(color, depth), world.time)

    def _clean(self, world: Visible, camera_in_base: Pose, appearance: Appearance) -> CleanFrame:
        if not self.config.reuse_still:
            return self._render(world, camera_in_base, appearance)
        what, where = _scene_fingerprint(world, camera_in_base, appearance)
        if self._last is None or self._last[0] != what or np.abs(self._last[1] - where).max() > _STILL_TOLERANCE:
            self._last = what, where, self._render(world, camera_in_base, appearance)
        return self._last[2]

    def _render(self, world: Visible, camera_in_base: Pose, appearance: Appearance) -> CleanFrame:
        frame = self._renderer.render(world, camera_in_base, appearance)
        if self._held is None:
            return frame
        return self._held.over(frame, world.panda.link_pose(world.panda.link_indices[ROBOT.hand_frame]), camera_in_base)

    def _in_full_frame(
        self, color: npt.NDArray[np.uint8], depth: npt.NDArray[np.float32]
    ) -> tuple[npt.NDArray[np.uint8], npt.NDArray[np.float32]]:
        height, width = self.intrinsics.height, self.intrinsics.width
        if depth.shape == (height, width):
            return color, depth
        full_color = np.zeros((height, width, 3), dtype=np.uint8)
        full_depth = np.full((height, width), np.nan, dtype=np.float32)
        full_color[self._window.slices] = color
        full_depth[self._window.slices] = depth
        return full_color, full_depth


def _scene_fingerprint(
    world: Visible, camera_in_base: Pose, appearance: Appearance
) -> tuple[object, npt.NDArray[np.float64]]:
    """Return the visible things with their light, to be compared for equality, and every pose as one row of numbers."""
    poses = [camera_in_base, *(world.object_pose(thing) for thing in world.objects)]
    poses += [world.panda.link_pose(index) for index in world.panda.link_indices.values()]
    where = np.concatenate([np.append(pose.rotation.ravel(), pose.translation) for pose in poses])
    return (tuple(world.objects), appearance), where
