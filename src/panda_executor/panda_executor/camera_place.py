"""The camera's position, as the frames of /tf_static say it."""

from __future__ import annotations

import threading

from cliport_core.errors import FrameError
from cliport_core.outcome import Refusal
from cliport_core.pose import Pose
from cliport_core.transforms import TransformTree
from panda_executor.errors import RequestError
from panda_model import FloatArray


class CameraPlace:
    """Joins the camera's frame to the base by the static transforms; safe between threads.

    Args:
        base_frame: the arm's.
    """

    def __init__(self, base_frame: str) -> None:
        self._base_frame = base_frame
        self._lock = threading.Lock()
        self._tree = TransformTree()
        self._camera_frame: str | None = None

    def put(self, parent: str, child: str, child_in_parent: Pose) -> None:
        """Take note of a static transform."""
        with self._lock:
            self._tree.put(parent, child, child_in_parent)

    def see(self, camera_frame: str) -> None:
        """Take note of the frame that the camera's own messages name."""
        with self._lock:
            self._camera_frame = camera_frame

    def position(self) -> FloatArray:
        """Return the optical centre (3,) [m, base frame].

        Raises:
            RequestError: while the camera's frame is unknown, or no static transform joins it to the base.
        """
        with self._lock:
            if self._camera_frame is None:
                raise RequestError(
                    "where the camera stands is not known: no camera_info has arrived; is it running?",
                    Refusal.NO_CAMERA_POSE,
                )
            try:
                return self._tree.source_in_target(self._camera_frame, self._base_frame).translation
            except FrameError as error:
                raise RequestError(
                    f"where the camera stands is not known: {error}; publish its calibration on /tf_static",
                    Refusal.NO_CAMERA_POSE,
                ) from None
