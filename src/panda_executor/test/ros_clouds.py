"""Points as the PointCloud2 that perception publishes."""

from __future__ import annotations

from array import array

import numpy as np
import numpy.typing as npt
from rclpy.serialization import serialize_message

from cliport_perception.conversions import cloud_to_msg


def raw_cloud(points: npt.NDArray[np.float32], stamp_ns: int, frame: str = "panda_link0") -> bytes:
    """Points (N, 3) [m], serialized."""
    rows = np.zeros((len(points), 4), np.float32)
    rows[:, :3] = points
    return bytes(serialize_message(cloud_to_msg(array("B", rows.tobytes()), frame, stamp_ns)))
