"""Heightmaps from ROS: the next one of a running graph, and those of a bag."""

from __future__ import annotations

import time
from contextlib import closing
from pathlib import Path

import rclpy
from rclpy.serialization import deserialize_message
from rclpy.utilities import try_shutdown

from cliport_core import topics
from cliport_core.heightmap import Heightmap
from cliport_core.messages import heightmap_from_msg
from cliport_interfaces.msg import Heightmap as HeightmapMsg
from cliport_policy.errors import DataError, ObservationError


def live_heightmap(timeout_s: float) -> Heightmap:
    """Return the next heightmap on /cliport/heightmap.

    Raises:
        ObservationError: if none comes in time.
    """
    received: list[HeightmapMsg] = []
    rclpy.init(args=[])
    try:
        node = rclpy.create_node("cliport_explain")
        node.create_subscription(HeightmapMsg, topics.HEIGHTMAP, received.append, 1)
        deadline = time.monotonic() + timeout_s
        while not received and time.monotonic() < deadline:
            rclpy.spin_once(node, timeout_sec=0.1)
        node.destroy_node()
    finally:
        try_shutdown()
    if not received:
        raise ObservationError(f"no heightmap on {topics.HEIGHTMAP} for {timeout_s:g} s: is the graph running?")
    return heightmap_from_msg(received[0])


def bag_heightmaps(folder: Path, number: int) -> tuple[Heightmap, Heightmap]:
    """Return a bag's heightmap of a number, counted from 0, and its last one.

    Raises:
        DataError: if the bag has none of that number.
    """
    from cliport_core.bag_library import open_reader

    try:
        with closing(open_reader(folder)) as bag:
            connections = [c for c in bag.connections if c.topic == topics.HEIGHTMAP]
            raw = [data for _, _, data in bag.messages(connections)] if connections else []
    except Exception as error:  # whatever rosbags says of a folder that is no bag
        raise DataError(f"{folder} can't be read as a bag ({' '.join(str(error).split())[:120]})") from None
    if not 0 <= number < len(raw):
        raise DataError(
            f"{folder} holds {len(raw)} heightmaps on {topics.HEIGHTMAP}, numbered from 0: there is none {number}"
        )
    chosen, last = (heightmap_from_msg(deserialize_message(bytes(raw[i]), HeightmapMsg)) for i in (number, -1))
    return chosen, last
