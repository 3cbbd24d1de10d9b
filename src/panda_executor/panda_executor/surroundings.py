"""The scene of a motion that a person asks for: the cameras' places and the newest cloud, without a goal."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from panda_executor import conversions
from panda_executor.camera_place import CameraPlace
from panda_executor.cloud_cache import CloudCache
from panda_executor.errors import RequestError
from panda_executor.transfer import TransferPlanner


class Surroundings:
    """Tells the planner where the cameras stand, and fetches the newest cloud.

    Args:
        now_ns: ROS time.
    """

    def __init__(
        self,
        planner: TransferPlanner,
        clouds: CloudCache,
        camera: CameraPlace,
        base_frame: str,
        now_ns: Callable[[], int],
    ) -> None:
        self._planner, self._clouds, self._camera = planner, clouds, camera
        self._base_frame, self._now_ns = base_frame, now_ns

    def missing(self) -> str:
        """Return what a motion cannot avoid at present, as a sentence; empty where a fresh cloud is there.

        Raises:
            RequestError: while it is not known where a camera stands.
        """
        self._camera.positions()
        try:
            self._clouds.get(self._now_ns(), 0, 0)
        except RequestError as error:
            return f"only the arm itself, the table, the camera and its post are avoided: {error}"
        return ""

    def cloud(self) -> npt.NDArray[np.float32] | None:
        """Return the newest cloud (N, 3) [m, base frame], None without one, once the planner avoids the cameras.

        Raises:
            RequestError: while it is not known where a camera stands.
        """
        self._planner.place_cameras(*self._camera.positions())
        try:
            return conversions.cloud_from_raw(self._clouds.get(self._now_ns(), 0, 0), self._base_frame)
        except RequestError:
            return None
