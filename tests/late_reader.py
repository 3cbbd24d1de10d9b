"""A reader of large messages that pauses: it says what memory it holds before, then, and after.

`python late_reader.py TOPIC` waits for a line on its input before each step, and answers with its megabytes.
"""

from __future__ import annotations

import sys
from pathlib import Path

import rclpy
from rclpy.qos import QoSProfile
from std_msgs.msg import UInt8MultiArray

from cliport_core.heap import trim_heap

QUEUE = 5  # messages, as of a picture


def main() -> None:
    rclpy.init()
    node = rclpy.create_node("late_reader")
    taken = 0

    def take(_message: UInt8MultiArray) -> None:
        nonlocal taken
        taken += 1

    node.create_subscription(UInt8MultiArray, sys.argv[1], take, QoSProfile(depth=QUEUE))
    say("ready")
    while taken < 2 * QUEUE:
        rclpy.spin_once(node)
    say(own_mb())
    input()  # behind by as much as the queue holds
    say(own_mb())
    before = taken
    while taken < before + 2 * QUEUE:
        rclpy.spin_once(node)
    trim_heap()
    say(own_mb())
    rclpy.shutdown()


def say(words: object) -> None:
    print(words, flush=True)


def own_mb() -> float:
    """Return the memory that is this process's own [MB]."""
    status = Path("/proc/self/status").read_text()
    return next(int(line.split()[1]) / 1024 for line in status.splitlines() if line.startswith("RssAnon"))


if __name__ == "__main__":
    main()
