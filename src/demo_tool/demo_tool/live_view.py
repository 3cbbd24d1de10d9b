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
from cliport_perception.depth_correction import AS_MEASURED, DepthCorrection

ColorImage = npt.NDArray[np.uint8]
DepthImage = npt.NDArray[np.float32]


def _as_it_is(raw: RawMessage) -> RawMessage:
    return raw


@dataclass(frozen=True, eq=False)
class LiveView:
    """Colour and depth of one stamp, and the messages that they came in.

    stamp_ns: stamp of the images; received_ns: time of receipt [both ns, ROS time]; frame: the camera's optical frame;
    camera_in_base: its pose in the base frame; raw: messages of this moment, as received; read_color and read_depth
    decode the images, and may raise CoreError; unpack makes of such a message the one to record; correction: of what
    the depth camera measures.
    """

    stamp_ns: int
    received_ns: int
    frame: str
    camera: CameraModel
    camera_in_base: Pose
    raw: tuple[RawMessage, ...]
    read_color: Callable[[], ColorImage]
    read_depth: Callable[[], DepthImage]
    unpack: Callable[[RawMessage], RawMessage] = _as_it_is
    correction: DepthCorrection = AS_MEASURED

    @cached_property
    def color(self) -> ColorImage:
        """Colour image, (H, W, 3) uint8 RGB."""
        return self.read_color()

    @cached_property
    def depth_m(self) -> DepthImage:
        """Corrected depth image, (H, W) float32 [m], NaN where unknown."""
        return self.correction.apply(self.read_depth())

    def to_record(self) -> tuple[RawMessage, ...]:
        """Return the messages to record: depth as it was measured, whatever corrects it. May raise CoreError."""
        return tuple(map(self.unpack, self.raw))
