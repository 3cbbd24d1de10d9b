"""The recorder: finds topics, subscribes to them, and writes what comes as it came."""

from __future__ import annotations

import re
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.topic_endpoint_info import TopicEndpointInfo

from ros2cli_small.bag.qos import offer_from_profile
from ros2cli_small.bag.type_definitions import type_definition
from ros2cli_small.bag.writer import BagWriter, RecordedTopic
from ros2cli_small.errors import CommandError
from ros2cli_small.graph import is_hidden, load_type
from ros2cli_small.qos import fit_publishers

POLL_PERIOD = 0.1  # s, between looks for new topics
FLUSH_PERIOD = 1.0  # s; what a killed recorder loses at most
DRAIN_TIME = 2.0  # s, at most, for what had arrived when the end came
DEPTH = 100  # messages that may wait while the disk is busy


@dataclass(frozen=True)
class Selection:
    """Choice of the topics that are recorded."""

    names: frozenset[str]
    all: bool = False
    regex: re.Pattern[str] | None = None

    def wants(self, topic: str) -> bool:
        """Return True if a topic is recorded; hidden ones only when they are named."""
        chosen = self.all or (self.regex is not None and self.regex.search(topic) is not None)
        return topic in self.names or (chosen and not is_hidden(topic))


class Recorder:
    """Records into a writer, which it closes. Messages get the time at which they arrived, or the node's (sim) time."""

    def __init__(
        self, node: Node, writer: BagWriter, selection: Selection, overrides: Mapping[str, QoSProfile]
    ) -> None:
        self._node, self._writer, self._selection, self._overrides = node, writer, selection, overrides
        self._sim_time = bool(node.get_parameter("use_sim_time").value)
        self._seen: set[str] = set()
        self._count = 0

    def run(self, ended: Callable[[], bool]) -> None:
        """Record until `ended` holds, then write what had arrived before, and complete the bag."""
        executor = SingleThreadedExecutor()
        executor.add_node(self._node)
        log = self._node.get_logger()
        log.info("Listening for topics...")
        next_poll = next_flush = time.monotonic()
        while not ended():
            now = time.monotonic()
            if now >= next_poll:
                self._subscribe_to_new_topics()
                next_poll = now + POLL_PERIOD
            if now >= next_flush:
                self._writer.flush()
                next_flush = now + FLUSH_PERIOD
            executor.spin_once(timeout_sec=POLL_PERIOD / 2)
        before, deadline = -1, time.monotonic() + DRAIN_TIME
        while self._count > before and time.monotonic() < deadline:
            before = self._count
            executor.spin_once(timeout_sec=0.0)
        executor.shutdown()
        self._writer.close()
        log.info(f"Recording stopped: {self._count} messages")

    def _subscribe_to_new_topics(self) -> None:
        for topic, types in self._node.get_topic_names_and_types():
            if topic in self._seen or not self._selection.wants(topic):
                continue
            publishers = self._node.get_publishers_info_by_topic(topic)
            if not publishers:
                continue
            self._seen.add(topic)
            if len(types) > 1:
                self._node.get_logger().warning(f"Topic '{topic}' has several types and is not recorded: {types}")
                continue
            try:
                message_class = load_type(types[0], "message")
            except CommandError:
                self._node.get_logger().warning(
                    f"Topic '{topic}' has unknown type '{types[0]}' and is not recorded: install its package"
                )
                continue
            self._subscribe(topic, types[0], message_class, publishers)

    def _subscribe(self, topic: str, kind: str, message_class: type, publishers: list[TopicEndpointInfo]) -> None:
        offers = tuple(offer_from_profile(info.qos_profile) for info in publishers)
        type_hash = str(publishers[0].topic_type_hash)
        self._writer.add_topic(RecordedTopic(topic, kind, type_definition(kind), type_hash, offers))
        profile = self._overrides.get(topic) or fit_publishers(self._node, topic, QoSProfile(depth=DEPTH))
        self._node.create_subscription(message_class, topic, partial(self._write, topic), profile, raw=True)
        self._node.get_logger().info(f"Subscribed to topic '{topic}'")

    def _write(self, topic: str, data: bytes, information: dict[str, Any]) -> None:
        stamp = self._node.get_clock().now().nanoseconds if self._sim_time else information["received_timestamp"]
        if not stamp:  # simulation time has not begun
            return
        if self._writer.write(topic, stamp, data):
            self._node.get_logger().info("Rolling over to new bag file")
        self._count += 1
