"""One moment of the camera: decoded only when somebody looks."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from cliport_episodes.raw import RawMessage
from cliport_perception.camera_model import CameraModel
from cliport_perception.pose import Pose

ColorImage = npt.NDArray[np.uint8]
DepthImage = npt.NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class LiveView:
    """Colour and depth of one stamp, and the messages that they came in.

    stamp_ns: of the images; received_ns: when they came [both ns, ROS time]; frame: of the camera; camera_in_base:
    pose of its optical frame; raw: what is recorded of this moment, bytes as they came; read_color and read_depth
    decode, and may raise PerceptionError.
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
        """(H, W, 3) uint8 RGB."""
        return self.read_color()

    @cached_property
    def depth_m(self) -> DepthImage:
        """(H, W) float32 [m], NaN where unknown."""
        return self.read_depth()
