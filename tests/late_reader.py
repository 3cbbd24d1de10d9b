"""`python late_reader.py TOPIC`: a reader of large messages that pauses until there is a line on its input.

It says when it is ready, and what memory is its own before and after the pause [MB].
"""

from __future__ import annotations

import sys

import rclpy
from process_memory import memory_mb
from std_msgs.msg import UInt8MultiArray

from cliport_core.adaptive_subscription import AdaptiveSubscription
from cliport_core.heap import trim_heap

MESSAGES = 10  # that it takes before the pause, and after it


def main() -> None:
    rclpy.init()
    node = rclpy.create_node("late_reader")
    taken = 0

    def take(_message: UInt8MultiArray) -> None:
        nonlocal taken
        taken += 1

    reader = AdaptiveSubscription(node, UInt8MultiArray, sys.argv[1], take)
    say("ready")
    while taken < MESSAGES or not reader.is_reliable:
        rclpy.spin_once(node)
        reader.adapt()
    trim_heap()
    say(memory_mb("RssAnon"))
    input()  # behind by as much as the queue holds
    taken = 0
    while taken < MESSAGES:
        rclpy.spin_once(node)
    trim_heap()
    say(memory_mb("RssAnon"))
    rclpy.shutdown()


def say(words: object) -> None:
    print(words, flush=True)


if __name__ == "__main__":
    main()
