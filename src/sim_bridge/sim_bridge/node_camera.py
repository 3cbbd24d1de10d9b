"""Publishes the simulated camera. Rendering has its own thread: physics hands it a snapshot and moves on."""

from __future__ import annotations

import threading
from queue import Empty, SimpleQueue
from typing import Any, cast

import numpy as np
from rclpy.node import Node
from rclpy.qos import QoSProfile
from sensor_msgs.msg import CameraInfo, Image

from cliport_core import topics
from sim_bridge.conversions import camera_info_to_msg, image_to_msg
from sim_bridge.node_faults import FaultInjection
from sim_bridge.rendering.camera import SimCamera
from sim_bridge.sim_loop import SimLoop
from sim_bridge.world import SimWorld
from sim_bridge.world_snapshot import WorldSnapshot

POLL_PERIOD_S = 0.01  # simulated time


class CameraPublisher:
    """Colour, aligned depth and camera_info with one stamp, the simulated time of the snapshot.

    A snapshot is taken only when the last one has been rendered; where that takes longer than from frame to frame,
    `is_behind` says so, and time has to wait. Nothing is rendered while nobody subscribes.
    """

    def __init__(
        self, node: Node, loop: SimLoop, camera: SimCamera, faults: FaultInjection, rate: float, frame_id: str
    ) -> None:
        self._loop = loop
        self._camera = camera
        self._faults = faults
        self._frame_id = frame_id
        self._logger = node.get_logger()
        self._rng = np.random.default_rng()
        self._snapshots: SimpleQueue[WorldSnapshot] = SimpleQueue()
        self._idle = threading.Event()
        self._period = 1.0 / rate
        self._next_time = 0.0
        qos = QoSProfile(depth=2)
        self._color = node.create_publisher(Image, topics.COLOR, qos)
        self._depth = node.create_publisher(Image, topics.DEPTH, qos)
        self._info = node.create_publisher(CameraInfo, topics.CAMERA_INFO, qos)
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, name="camera", daemon=True)
        loop.every(POLL_PERIOD_S, self._tick)

    def is_behind(self) -> bool:
        """Return True while a frame is due and the last one is not rendered yet."""
        return self._loop.world.time >= self._next_time - 1e-9 and not self._idle.is_set()

    def start(self) -> None:
        """Begin to render."""
        self._thread.start()

    def stop(self) -> None:
        """End the thread after the frame in hand."""
        self._stopping.set()
        if self._thread.is_alive():
            self._thread.join(timeout=5.0)

    def _tick(self, time: float, state: Any) -> None:
        if time < self._next_time - 1e-9 or self._faults.camera_frozen or not self._idle.is_set():
            return
        if not self._color.get_subscription_count() and not self._depth.get_subscription_count():
            return
        self._idle.clear()
        late = time > self._next_time + self._period
        self._next_time = (time if late else self._next_time) + self._period
        self._snapshots.put(WorldSnapshot(cast(SimWorld, self._loop.world)))

    def _run(self) -> None:
        while not self._stopping.is_set():
            self._idle.set()
            try:
                snapshot = self._snapshots.get(timeout=0.1)
            except Empty:
                continue
            try:
                self._publish(snapshot)
            except Exception as error:
                if not self._stopping.is_set():
                    self._logger.error(f"no image: {error}", throttle_duration_sec=5.0)

    def _publish(self, snapshot: WorldSnapshot) -> None:
        where = self._faults.true_pose(self._camera.camera_in_base)
        frame = self._camera.capture(cast(SimWorld, snapshot), self._rng, true_camera_in_base=where)
        depth = np.full_like(frame.depth, np.nan) if self._faults.depth_lost else frame.depth
        if self._faults.camera_frozen or self._stopping.is_set():
            return
        self._info.publish(camera_info_to_msg(self._camera.intrinsics, self._frame_id, frame.time))
        self._color.publish(image_to_msg(frame.color, "rgb8", self._frame_id, frame.time))
        self._depth.publish(image_to_msg(depth, "32FC1", self._frame_id, frame.time))
