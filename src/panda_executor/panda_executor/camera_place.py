"""The cameras' positions, as the frames of /tf_static say it."""

from __future__ import annotations

import threading

from cliport_core.errors import FrameError
from cliport_core.outcome import Refusal
from cliport_core.pose import Pose
from cliport_core.transforms import TransformTree
from panda_executor.errors import RequestError
from panda_model import FloatArray


class CameraPlace:
    """Joins the cameras' frames to the base by the static transforms; safe between threads.

    Args:
        base_frame: the arm's; count: of the cameras.
    """

    def __init__(self, base_frame: str, count: int = 1) -> None:
        self._base_frame, self._count = base_frame, count
        self._lock = threading.Lock()
        self._tree = TransformTree()
        self._frames: dict[int, str] = {}

    def put(self, parent: str, child: str, child_in_parent: Pose) -> None:
        """Take note of a static transform."""
        with self._lock:
            self._tree.put(parent, child, child_in_parent)

    def see(self, camera_frame: str, number: int = 1) -> None:
        """Take note of the frame that a camera's own messages name; number: the camera's, from 1."""
        with self._lock:
            self._frames[number] = camera_frame

    def positions(self) -> tuple[FloatArray, ...]:
        """Return the optical centre of each camera (3,) [m, base frame].

        Raises:
            RequestError: while a camera's frame is unknown, or no static transform joins it to the base.
        """
        with self._lock:
            return tuple(self._position(number) for number in range(1, self._count + 1))

    def _position(self, number: int) -> FloatArray:
        name = "camera" if number == 1 else f"camera {number}"
        if number not in self._frames:
            raise RequestError(
                f"where the {name} stands is not known: no camera_info has arrived; is it running?",
                Refusal.NO_CAMERA_POSE,
            )
        try:
            return self._tree.source_in_target(self._frames[number], self._base_frame).translation
        except FrameError as error:
            raise RequestError(
                f"where the {name} stands is not known: {error}; publish its calibration on /tf_static",
                Refusal.NO_CAMERA_POSE,
            ) from None
