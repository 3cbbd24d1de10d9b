"""The real perception node on one core, fed by a camera: its rate, and how old its products are when they arrive."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial

import numpy as np
from rclpy.context import Context
from rclpy.node import Node
from rclpy.qos import QoSProfile
from sensor_msgs.msg import CameraInfo, Image, PointCloud2
from tf2_msgs.msg import TFMessage

from cliport_benchmark.camera_messages import observation_messages
from cliport_benchmark.errors import BenchmarkError
from cliport_benchmark.graph_client import LATCHED
from cliport_benchmark.process_time import cpu_seconds
from cliport_core import topics
from cliport_core.raw_header import header_of_raw
from cliport_core.ros_running import SpinThread
from cliport_interfaces.msg import Heightmap
from sim_bridge.rendering.camera import SimCamera
from sim_bridge.scene import reset_scene
from sim_bridge.world import SimWorld

RATE_HZ = 10.0  # of the camera
DOMAIN = 77  # of its own, so that no graph beside it is heard
_WARM_UP_S, _READY_S, _END_S = 3.0, 60.0, 10.0
_N_FRAMES = 5  # with noise of their own, shown in turn
_NODE = "import sys; from cliport_perception.node import main; sys.exit(main())"
_KINDS = {topics.TF_STATIC: TFMessage, topics.CAMERA_INFO: CameraInfo, topics.COLOR: Image, topics.DEPTH: Image}


def node_figures(task: str, seconds: float = 30.0) -> dict[str, list[float]]:
    """Measure the node for some time with its own parameters, its process pinned on one core, the camera on the others.

    rate [Hz]: of heightmaps, over the whole time. heightmap, cloud [ms]: age of each at its arrival, from the stamp of
    its images. cores: the process's time over wall time.

    Raises:
        BenchmarkError: when the node does not start, or ends.
    """
    images = _images(task)
    core, *others = sorted(os.sched_getaffinity(0), reverse=True)
    with _kept_off(others), _Camera(images) as camera, _node_on(core) as process:
        camera.wait_heard(process)
        time.sleep(_WARM_UP_S)
        used, began = cpu_seconds(process.pid), camera.forget()
        time.sleep(seconds)
        if process.poll() is not None:
            raise BenchmarkError(f"the perception node ended with status {process.returncode}")
        used, took = cpu_seconds(process.pid) - used, time.monotonic() - began
        heightmaps, clouds = camera.ages[topics.HEIGHTMAP], camera.ages[topics.POINTS]
        if not heightmaps or not clouds:
            raise BenchmarkError(f"{len(heightmaps)} heightmaps and {len(clouds)} clouds came in {took:.0f} s")
        return {"rate": [len(heightmaps) / took], "heightmap": heightmaps, "cloud": clouds, "cores": [used / took]}


def _images(task: str) -> list[dict[str, bytes]]:
    """Return serialized messages by topic, of one scene of the simulator with ever new noise."""
    world, camera, rng = SimWorld(), SimCamera(), np.random.default_rng(0)
    reset_scene(world, task, "test", 0, "")
    told = camera.intrinsics, camera.camera_in_base, world.panda.state(), 0
    made = [observation_messages(camera.capture(world, rng), *told) for _ in range(_N_FRAMES)]
    world.close()
    return [{raw.topic: raw.data for raw in messages if raw.topic in _KINDS} for messages in made]


class _Camera:
    """A camera that speaks from the context's beginning to its end, and hears what becomes of its frames."""

    def __init__(self, images: list[dict[str, bytes]]) -> None:
        self._images = images
        self.ages: dict[str, list[float]] = {topics.HEIGHTMAP: [], topics.POINTS: []}
        self._context = Context()
        self._context.init(domain_id=DOMAIN)
        self._node = Node("bench_camera", context=self._context)
        qos = QoSProfile(depth=2)
        self._publishers = {
            topic: self._node.create_publisher(kind, topic, LATCHED if kind is TFMessage else qos)
            for topic, kind in _KINDS.items()
        }
        for topic, kind in ((topics.HEIGHTMAP, Heightmap), (topics.POINTS, PointCloud2)):
            self._node.create_subscription(kind, topic, partial(self._take, topic), qos, raw=True)
        self._ending = threading.Event()
        self._thread = threading.Thread(target=self._speak, name="bench_camera", daemon=True)

    def __enter__(self) -> _Camera:
        self._spinner = SpinThread(self._node, lambda _: None, self._context)
        self._publishers[topics.TF_STATIC].publish(self._images[0][topics.TF_STATIC])
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ending.set()
        self._thread.join()
        self._spinner.stop()
        self._node.destroy_node()
        self._context.try_shutdown()

    def wait_heard(self, process: subprocess.Popen[bytes]) -> None:
        """Wait for the first heightmap. Raises BenchmarkError."""
        deadline = time.monotonic() + _READY_S
        while not self.ages[topics.HEIGHTMAP]:
            if process.poll() is not None or time.monotonic() > deadline:
                raise BenchmarkError(f"the perception node made no heightmap within {_READY_S:.0f} s")
            time.sleep(0.05)

    def forget(self) -> float:
        """Forget all ages; return the time [s]."""
        self.ages = {topic: [] for topic in self.ages}
        return time.monotonic()

    def _take(self, topic: str, raw: bytes) -> None:
        self.ages[topic].append((time.time_ns() - header_of_raw(raw)[0]) * 1e-6)

    def _speak(self) -> None:
        begin, number = time.monotonic(), 0
        while not self._ending.wait(max(0.0, begin + number / RATE_HZ - time.monotonic())):
            stamp_ns = time.time_ns()
            for topic, raw in self._images[number % len(self._images)].items():
                if topic != topics.TF_STATIC:
                    self._publishers[topic].publish(stamped(raw, stamp_ns))
            number += 1


def stamped(raw: bytes, stamp_ns: int) -> bytes:
    """Return a serialized message that begins with a header, with another stamp [ns]; little-endian."""
    seconds, nanoseconds = divmod(stamp_ns, 1_000_000_000)
    return raw[:4] + seconds.to_bytes(4, "little") + nanoseconds.to_bytes(4, "little") + raw[12:]


@contextmanager
def _node_on(core: int) -> Iterator[subprocess.Popen[bytes]]:
    """Run the perception node as a process of its own, all of its threads on one core."""
    environment = {**os.environ, "ROS_DOMAIN_ID": str(DOMAIN), "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
    process = subprocess.Popen(
        [sys.executable, "-c", _NODE], env=environment, preexec_fn=lambda: os.sched_setaffinity(0, {core})
    )
    try:
        yield process
    finally:
        process.terminate()
        try:
            process.wait(_END_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


@contextmanager
def _kept_off(cores: list[int]) -> Iterator[None]:
    """Keep this process on some cores, where there are any."""
    before = os.sched_getaffinity(0)
    os.sched_setaffinity(0, cores or before)
    try:
        yield
    finally:
        os.sched_setaffinity(0, before)
