"""Helpers for the tests of `ros2 bag`: bags as rosbag2 lays them out, and a node that publishes and listens."""

from __future__ import annotations

import importlib
import os
import signal
import sqlite3
import subprocess
import threading
import time
from collections import defaultdict
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import rclpy
import yaml
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.serialization import deserialize_message, serialize_message
from ros2_process import ROS2, TIMEOUT
from rosbags.interfaces import Qos, QosDurability, QosHistory, QosLiveliness, QosReliability, QosTime
from rosbags.rosbag2 import Reader, StoragePlugin, Writer
from rosbags.rosbag2.enums import CompressionFormat, CompressionMode
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from cliport_interfaces.msg import WorkspaceSpec

MATCHING_TIME = 0.5  # s, for two ends that know of each other to be connected
START = 1_700_000_000_000_000_000  # ns, of the written bags
BEST_EFFORT = QoSProfile(depth=100, reliability=ReliabilityPolicy.BEST_EFFORT)
LATCHED = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)
INFINITE = QosTime(9223372036, 854775807)

Row = tuple[str, float, Any]  # topic, seconds after START, message


def type_name(message: Any) -> str:
    """Return `package/msg/Name` of a message."""
    return f"{type(message).__module__.split('.')[0]}/msg/{type(message).__name__}"


def write_bag(
    folder: Path, rows: Sequence[Row], storage: str = "mcap", version: int = 9, types: dict[str, str] | None = None,
    latched: Sequence[str] = (), compressed: bool = False,
) -> list[tuple[str, int, bytes]]:  # fmt: skip
    """Write a bag as Jazzy (metadata version 9) or Humble (5) does; return topic, time and data of its messages."""
    writer = Writer(folder, version=9 if version == 9 else 8, storage_plugin=StoragePlugin[storage.upper()])
    if compressed:
        writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
    connections: dict[str, Any] = {}
    written = []
    with writer:
        for topic, seconds, message in rows:
            if topic not in connections:
                kind = (types or {}).get(topic, type_name(message))
                connections[topic] = writer.add_connection(
                    topic, kind, msgdef="", rihs01="RIHS01_0", offered_qos_profiles=[_offer(topic in latched)]
                )
            data = serialize_message(message)
            data += bytes(-len(data) % 4)  # as it comes over the wire
            written.append((topic, START + round(seconds * 1e9), data))
            writer.write(connections[topic], *written[-1][1:])
    if version == 5:
        _make_humble(folder, storage)
    return written


def _offer(latched: bool) -> Qos:
    durability = QosDurability.TRANSIENT_LOCAL if latched else QosDurability.VOLATILE
    return Qos(
        QosHistory.UNKNOWN, 0, QosReliability.RELIABLE, durability, INFINITE, INFINITE, QosLiveliness.AUTOMATIC,
        INFINITE, False,
    )  # fmt: skip


def _make_humble(folder: Path, storage: str) -> None:
    path = folder / "metadata.yaml"
    metadata = yaml.safe_load(path.read_text())
    information = metadata["rosbag2_bagfile_information"]
    information["version"] = 5
    for newer in ("custom_data", "ros_distro"):
        del information[newer]
    for topic in information["topics_with_message_count"]:
        del topic["topic_metadata"]["type_description_hash"]
    path.write_text(yaml.safe_dump(metadata))
    if storage == "sqlite3":
        with sqlite3.connect(storage_file(folder)) as database:
            database.executescript(
                "DROP TABLE message_definitions; ALTER TABLE topics DROP COLUMN type_description_hash;"
                "UPDATE schema SET schema_version = 3;"
            )
        database.close()


def storage_file(folder: Path) -> Path:
    """Return the one storage file of a bag."""
    (file,) = (path for path in folder.iterdir() if path.suffix in (".mcap", ".db3"))
    return file


def read_bag(folder: Path) -> dict[str, list[tuple[int, bytes]]]:
    """Read a bag with the library alone: times and data by topic."""
    found: dict[str, list[tuple[int, bytes]]] = defaultdict(list)
    with Reader(folder) as reader:
        for connection, stamp, data in reader.messages():
            found[connection.topic].append((stamp, bytes(data)))
    return found


def wait_for(condition: Callable[[], Any], timeout: float = TIMEOUT) -> bool:
    """Wait until something holds, and tell whether it does."""
    deadline = time.monotonic() + timeout
    while not condition():
        if time.monotonic() > deadline:
            return False
        time.sleep(0.01)
    return True


class BagGraph:
    """A domain with a node in it, and `ros2 bag` beside it."""

    def __init__(self, domain: int) -> None:
        self.environment = {**os.environ, "ROS_DOMAIN_ID": str(domain), "PYTHONUNBUFFERED": "1"}
        self.heard: dict[str, list[tuple[int, bytes]]] = defaultdict(list)
        self.expected: set[str] = set()  # what must be published before a bag is played
        self._context = Context()
        rclpy.init(context=self._context, domain_id=domain)
        self.node = rclpy.create_node("bag_graph", context=self._context, start_parameter_services=False)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self.node)
        self._thread = threading.Thread(target=self._executor.spin, daemon=True)
        self._thread.start()
        self._started: list[subprocess.Popen[str]] = []

    def close(self) -> None:
        """End what runs, and the node."""
        for process in self._started:
            if process.poll() is None:
                process.terminate()
            if process.stdout and not process.stdout.closed:
                process.communicate(timeout=TIMEOUT)
        self._executor.shutdown()
        self._thread.join()
        self.node.destroy_node()
        rclpy.shutdown(context=self._context)

    def listen(self, topic: str, kind: type, profile: QoSProfile | None = None) -> None:
        """Keep arrival time (ns) and data of what comes on a topic."""
        self.expected.add(topic)
        self.node.create_subscription(
            kind, topic, partial(self._hear, topic), profile or QoSProfile(depth=1000), raw=True
        )

    def _hear(self, topic: str, data: bytes, information: dict[str, Any]) -> None:
        self.heard[topic].append((information["received_timestamp"], data))

    def texts(self, topic: str) -> list[str]:
        """Return what the String messages heard on a topic say."""
        return [deserialize_message(data, String).data for data in self.data(topic)]

    def data(self, topic: str) -> list[bytes]:
        """Return what was heard on a topic."""
        return [data for _, data in self.heard[topic]]

    def start(self, *arguments: str | Path, **options: Any) -> subprocess.Popen[str]:
        """Start `ros2 bag`; its output, both kinds, comes through a pipe."""
        pipes = {"stdin": subprocess.DEVNULL, "stdout": subprocess.PIPE, "stderr": subprocess.STDOUT}
        command = [ROS2, "bag", *map(str, arguments)]
        process = subprocess.Popen(command, text=True, **{"env": self.environment, **pipes, **options})
        self._started.append(process)
        return process

    def record(self, folder: Path, *arguments: str | Path, topics: Sequence[str]) -> subprocess.Popen[str]:
        """Start to record, and wait until all topics, which are published, are subscribed to."""
        process = self.start("record", "-o", folder, *arguments, "--topics", *topics)
        assert wait_for(lambda: all(self.node.count_subscribers(topic) for topic in topics))
        return process

    def play(self, bag: Path, *arguments: str | Path) -> subprocess.Popen[str]:
        """Start to play, and go on when it and all who listen have found each other, however long that takes."""
        process = self.start("play", bag, "-p", *arguments)
        self.resume()
        return process

    def resume(self) -> None:
        """Let a player that is paused go on when all have found each other."""
        assert wait_for(lambda: self._services().get("/rosbag2_player/resume"))
        assert wait_for(lambda: all(self.node.count_publishers(topic) for topic in self.expected))
        time.sleep(MATCHING_TIME)
        self.call_player("resume")

    def call_player(self, name: str) -> None:
        """Call one of the player's services, which have no more than a name."""
        full = f"/rosbag2_player/{name}"
        package, _, short = self._services()[full][0].split("/")
        kind = getattr(importlib.import_module(f"{package}.srv"), short)
        client = self.node.create_client(kind, full)
        assert client.wait_for_service(5.0)
        assert wait_for(client.call_async(kind.Request()).done)

    def _services(self) -> dict[str, list[str]]:
        return dict(self.node.get_service_names_and_types())


def end(process: subprocess.Popen[str], number: int = signal.SIGINT) -> tuple[int, str]:
    """Signal a process; its exit status and what it said."""
    process.send_signal(number)
    output, _ = process.communicate(timeout=TIMEOUT)
    return process.returncode, output


def publish(graph: BagGraph, seconds: float) -> None:
    """Publish joint states at 100 Hz, best effort, and a workspace at 10 Hz."""
    joints = graph.node.create_publisher(JointState, "/joint_states", BEST_EFFORT)
    workspace = graph.node.create_publisher(WorkspaceSpec, "/workspace", 10)
    assert wait_for(lambda: joints.get_subscription_count() and workspace.get_subscription_count())
    began = time.monotonic()
    for k in range(round(seconds * 100)):
        joints.publish(JointState(name=["panda_joint1"], position=[0.01 * k]))
        if k % 10 == 0:
            workspace.publish(WorkspaceSpec())
        time.sleep(max(0.0, began + 0.01 * (k + 1) - time.monotonic()))


def bag_command(*arguments: str | Path) -> subprocess.CompletedProcess[str]:
    """Run `ros2 bag` to its end."""
    return subprocess.run(
        [ROS2, "bag", *map(str, arguments)], capture_output=True, text=True, timeout=TIMEOUT, stdin=subprocess.DEVNULL
    )
