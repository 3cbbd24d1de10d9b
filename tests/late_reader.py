"""`python late_reader.py TOPIC`: a reader of large messages that pauses until there is a line on its input.

It says when it is ready, and what memory is its own before, in and after the pause [MB].
"""

from __future__ import annotations

import sys

import rclpy
from process_memory import memory_mb
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
    say(memory_mb("RssAnon"))
    input()  # behind by as much as the queue holds
    say(memory_mb("RssAnon"))
    before = taken
    while taken < before + 2 * QUEUE:
        rclpy.spin_once(node)
    trim_heap()
    say(memory_mb("RssAnon"))
    rclpy.shutdown()


def say(words: object) -> None:
    print(words, flush=True)


if __name__ == "__main__":
    main()
