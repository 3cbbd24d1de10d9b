"""The player: publishes a bag's messages as they were recorded, and can be paused."""

from __future__ import annotations

import re
import threading
import time
from collections import deque
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

from builtin_interfaces.msg import Time
from rclpy.duration import Duration
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rosgraph_msgs.msg import Clock

from ros2cli_small.bag.keyboard import key_presses
from ros2cli_small.bag.playback_clock import SECOND, PlaybackClock
from ros2cli_small.bag.qos import profile_from_offers
from ros2cli_small.bag.reader import Bag, warn
from ros2cli_small.errors import CommandError
from ros2cli_small.graph import full_name, load_type

CLOCK_TOPIC = "/clock"
ARRIVAL_TIME = 1.0  # s, at most, for the last messages to reach reliable subscribers


class Player:
    """Plays a bag with one publisher a topic. The services are the real player's, on the node that is handed in."""

    def __init__(
        self,
        node: Node,
        bag: Bag,
        topics: Collection[str],
        overrides: Mapping[str, QoSProfile],
        rate: float,
        paused: bool,
        clock_rate: float | None,
    ) -> None:
        self._node, self._bag = node, bag
        self._clock = PlaybackClock(rate, paused)
        self._ticks = ClockTicks(_clock_publisher(node), self._clock, clock_rate) if clock_rate else None
        self._publishers = self._create_publishers(topics, overrides)
        self._offer_service("Pause", lambda: self._set_paused(True))
        self._offer_service("Resume", lambda: self._set_paused(False))
        self._offer_service("TogglePaused", self._toggle)

    def run(self, span: tuple[int, int], delay: float, loop: bool, keyboard: bool) -> None:
        """Play the span of bag times once, or for ever; `delay` in seconds comes before each time."""
        with self._services_answered(), key_presses(self._on_key, keyboard) as listening:
            if listening:
                self._node.get_logger().info("Press SPACE for Pause/Resume")
            while True:
                time.sleep(delay)
                self._play(*span)
                if not loop:
                    break
            for publisher in self._publishers.values():
                publisher.wait_for_all_acked(Duration(seconds=ARRIVAL_TIME))

    def _play(self, start: int, stop: int) -> None:
        self._clock.jump(start)
        self._publish_latched(start)
        for topic, stamp, data in self._bag.messages(self._publishers, start, stop):
            while not self._clock.wait_until(stamp, self._ticks.publish_when_due() if self._ticks else None):
                pass
            self._publishers[topic].publish(data)

    def _publish_latched(self, start: int) -> None:
        """Publish what a node that came at `start` would still have got."""
        latched = {
            name: publisher.qos_profile.depth
            for name, publisher in self._publishers.items()
            if publisher.qos_profile.durability == DurabilityPolicy.TRANSIENT_LOCAL
        }
        if start <= self._bag.start or not latched:
            return
        kept = {name: deque[bytes](maxlen=depth) for name, depth in latched.items()}
        for topic, _, data in self._bag.messages(latched, None, start):
            kept[topic].append(data)
        for topic, messages in kept.items():
            for data in messages:
                self._publishers[topic].publish(data)

    def _create_publishers(self, topics: Collection[str], overrides: Mapping[str, QoSProfile]) -> dict[str, Publisher]:
        wanted = {full_name(self._node, topic) for topic in topics} or set(self._bag.topics)
        chosen = [topic for name, topic in self._bag.topics.items() if name in wanted]
        if not chosen:
            known = ", ".join(sorted(self._bag.topics)) or "none"
            raise CommandError(f"No topic to play: bag '{self._bag.path}' has {known}")
        publishers, unknown = {}, []
        for topic in chosen:
            if topic.name == CLOCK_TOPIC and self._ticks:  # time has one source
                continue
            try:
                message_class = load_type(topic.type, "message")
            except CommandError:
                unknown.append(topic)
                continue
            profile = overrides.get(topic.name) or profile_from_offers(topic.name, topic.offers)
            publishers[topic.name] = self._node.create_publisher(message_class, topic.name, profile)
        if unknown and not publishers:
            types = ", ".join(sorted({topic.type for topic in unknown}))
            raise CommandError(f"Nothing to play in bag '{self._bag.path}': install the packages of {types}")
        for topic in unknown:
            warn(f"Ignoring topic '{topic.name}': its type '{topic.type}' is unknown; install its package")
        return publishers

    def _offer_service(self, name: str, act: Callable[[], None]) -> None:
        def answer(_request: Any, response: Any) -> Any:
            act()
            return response

        snake = re.sub(r"(?<=.)(?=[A-Z])", "_", name).lower()
        service_type = load_type(f"rosbag2_interfaces/srv/{name}", "service")
        self._node.create_service(service_type, f"~/{snake}", answer)

    def _on_key(self, key: str) -> None:
        if key == " ":
            self._toggle()

    def _toggle(self) -> None:
        self._set_paused(not self._clock.paused)

    def _set_paused(self, paused: bool) -> None:
        self._clock.set_paused(paused)
        self._node.get_logger().info("Pausing play." if paused else "Resuming play.")

    @contextmanager
    def _services_answered(self) -> Iterator[None]:
        executor = SingleThreadedExecutor()
        executor.add_node(self._node)
        thread = threading.Thread(target=executor.spin, name="services", daemon=True)
        thread.start()
        try:
            yield
        finally:
            executor.shutdown()
            thread.join()


class ClockTicks:
    """Publishes the bag's time at a steady rate in Hz, also while the bag is paused.

    `publish` takes nanoseconds; `steady` tells a steady time in seconds.
    """

    def __init__(
        self,
        publish: Callable[[int], None],
        clock: PlaybackClock,
        rate: float,
        steady: Callable[[], float] = time.monotonic,
    ) -> None:
        self._publish, self._clock, self._period, self._steady = publish, clock, 1.0 / rate, steady
        self._next = steady()

    def publish_when_due(self) -> float:
        """Publish if it is time, and return in how many seconds it is time again."""
        now = self._steady()
        if now >= self._next:
            self._publish(self._clock.now())
            self._next = max(self._next + self._period, now)
        return max(0.0, self._next - now)


def _clock_publisher(node: Node) -> Callable[[int], None]:
    """Return what publishes a time in nanoseconds on /clock."""
    best_effort = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
    publisher = node.create_publisher(Clock, CLOCK_TOPIC, best_effort)

    def publish(nanoseconds: int) -> None:
        seconds, rest = divmod(nanoseconds, SECOND)
        publisher.publish(Clock(clock=Time(sec=seconds, nanosec=rest)))

    return publish
