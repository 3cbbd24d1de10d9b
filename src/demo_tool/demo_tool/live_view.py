"""Images of one moment of the camera, decoded only when somebody looks."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from cliport_core.pose import Pose
from cliport_episodes.raw import RawMessage
from cliport_perception.camera_model import CameraModel

ColorImage = npt.NDArray[np.uint8]
DepthImage = npt.NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class LiveView:
    """Colour and depth of one stamp, and the messages that they came in.

    stamp_ns: stamp of the images; received_ns: time of receipt [both ns, ROS time]; frame: the camera's optical frame;
    camera_in_base: its pose in the base frame; raw: messages to record of this moment, as received; read_color and
    read_depth decode the images, and may raise CoreError.
    """

    stamp_ns: int
    received_ns: int
    frame: str
    camera: CameraModel
    camera_in_base: Pose
    raw: tuple[RawMessage, ...]
    read_color: Callable[[], ColorImage]
    read_depth: Callable[[], DepthImage]

    @cached_property
    def color(self) -> ColorImage:
        """Colour image, (H, W, 3) uint8 RGB."""
        return self.read_color()

    @cached_property
    def depth_m(self) -> DepthImage:
        """Depth image, (H, W) float32 [m], NaN where unknown."""
        return self.read_depth()
