"""ros2 topic hz: how often messages arrive."""

from __future__ import annotations

import argparse
import math
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from ros2cli_small.graph import (
    add_node_arguments,
    command_node,
    full_name,
    load_type,
    spin_until,
    topic_types,
    wait_for_topic_type,
)

DEFAULT_WINDOW = 10000
PRINT_PERIOD = 1.0  # s


@dataclass(frozen=True)
class Rate:
    """What is known of the gaps between messages, in seconds."""

    mean: float
    shortest: float
    longest: float
    deviation: float
    count: int

    def __str__(self) -> str:
        rate = 1.0 / self.mean if self.mean > 0.0 else 0.0
        return (
            f"average rate: {rate:.3f}\n\tmin: {self.shortest:.3f}s max: {self.longest:.3f}s "
            f"std dev: {self.deviation:.5f}s window: {self.count}"
        )


class RateMeter:
    """Keeps the gaps between the last messages. Times are seconds, handed in."""

    def __init__(self, window: int) -> None:
        self._gaps: deque[float] = deque(maxlen=window)
        self._last: float | None = None
        self._reported: float | None = None

    def message_at(self, now: float) -> None:
        """Count a message; a clock that went back starts all over."""
        if self._last is not None and now >= self._last:
            self._gaps.append(now - self._last)
        elif self._last is not None:
            self._gaps.clear()
            self._reported = None
        self._last = now

    def report(self) -> Rate | None:
        """Return the rate, at most once a second and only when messages came since; else None."""
        if not self._gaps or self._last is None:
            return None
        if self._reported is None:
            self._reported = self._last
            return None
        if self._last < self._reported + PRINT_PERIOD:
            return None
        self._reported = self._last
        count = len(self._gaps)
        mean = sum(self._gaps) / count
        deviation = math.sqrt(sum((gap - mean) ** 2 for gap in self._gaps) / count)
        return Rate(mean, min(self._gaps), max(self._gaps), deviation, count)


def positive_int(text: str) -> int:
    """Read a window size."""
    value = int(text) if text.lstrip("-").isdigit() else 0
    if value <= 0:
        raise argparse.ArgumentTypeError("value must be a positive integer")
    return value


def add_parser(verbs: Any) -> None:
    """Add `topic hz` to the command line."""
    parser = verbs.add_parser("hz", help="Print the average receiving rate to screen")
    add_node_arguments(parser, daemon=False)
    parser.add_argument("topic_name", help="Name of the ROS topic to listen to (e.g. '/chatter')")
    parser.add_argument(
        "-w", "--window", type=positive_int, default=DEFAULT_WINDOW,
        help=f"window size, in # of messages, for calculating rate (default: {DEFAULT_WINDOW})",
    )  # fmt: skip
    parser.add_argument("--wall-time", action="store_true", help="calculates rate using wall time")
    parser.set_defaults(main=main)


def main(args: argparse.Namespace) -> int:
    """Print the rate every second until Ctrl-C."""
    from rclpy.qos import qos_profile_sensor_data

    meter = RateMeter(args.window)
    with command_node(args.use_sim_time) as node:
        topic = full_name(node, args.topic_name)
        kind = wait_for_topic_type(node, topic, args.spin_time)
        if kind is None:
            print(f"WARNING: topic [{topic}] does not appear to be published yet", flush=True)
            spin_until(node, lambda: bool(topic_types(node, topic)))
            kind = wait_for_topic_type(node, topic, 0.0)
        clock: Callable[[], float] = time.time
        if args.use_sim_time and not args.wall_time:
            clock = lambda: node.get_clock().now().nanoseconds * 1e-9  # noqa: E731
        node.create_subscription(
            load_type(str(kind), "message"),
            topic,
            lambda _message: meter.message_at(clock()),
            qos_profile_sensor_data,  # it hears reliable publishers too
            raw=True,
        )

        def report() -> bool:
            rate = meter.report()
            if rate is not None:
                print(rate, flush=True)
            return False

        spin_until(node, report)
    return 0
