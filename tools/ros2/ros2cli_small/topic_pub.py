"""ros2 topic pub: publish a message, once or at a rate."""

from __future__ import annotations

import argparse
import time
from typing import Any

from ros2cli_small.errors import CommandError
from ros2cli_small.graph import add_node_arguments, command_node, full_name, load_type, spin_until
from ros2cli_small.message_values import fill_message, parse_values
from ros2cli_small.qos import add_qos_arguments, profile_from_flags


def positive_float(text: str) -> float:
    """Read a rate."""
    value = float(text)
    if value <= 0.0:
        raise argparse.ArgumentTypeError("value must be positive")
    return value


def nonnegative_int(text: str) -> int:
    """Read a count."""
    value = int(text)
    if value < 0:
        raise argparse.ArgumentTypeError("value must not be negative")
    return value


def add_parser(verbs: Any) -> None:
    """Add `topic pub` to the command line."""
    parser = verbs.add_parser("pub", help="Publish a message to a topic")
    parser.add_argument("topic_name", help="Name of the ROS topic to publish to (e.g. '/chatter')")
    parser.add_argument("message_type", help="Type of the ROS message (e.g. 'std_msgs/msg/String')")
    parser.add_argument("values", nargs="?", default="{}", help="Values to fill the message with in YAML format")
    parser.add_argument("-r", "--rate", metavar="N", type=positive_float, default=1.0, help="Publishing rate in Hz")
    parser.add_argument(
        "-p", "--print", metavar="N", type=int, default=1, help="Only print every N-th published message"
    )
    group = parser.add_mutually_exclusive_group()
    group.add_argument("-1", "--once", action="store_true", help="Publish one message and exit")
    group.add_argument("-t", "--times", type=nonnegative_int, default=0, help="Publish this number of times and exit")
    parser.add_argument(
        "-w", "--wait-matching-subscriptions", type=nonnegative_int, default=None,
        help='Wait until finding the specified number of matching subscriptions. '
        'Defaults to 1 when using "-1"/"--once"/"--times", otherwise defaults to 0.',
    )  # fmt: skip
    parser.add_argument(
        "--max-wait-time-secs", type=positive_float, default=None,
        help="The maximum wait time in seconds when waiting for matching subscriptions",
    )  # fmt: skip
    parser.add_argument(
        "--keep-alive", metavar="N", type=positive_float, default=0.1,
        help="Keep publishing node alive for N seconds after the last msg (default: 0.1)",
    )  # fmt: skip
    parser.add_argument("-n", "--node-name", help="Name of the created publishing node")
    add_qos_arguments(parser, "default")
    add_node_arguments(parser, daemon=False)
    parser.set_defaults(main=main)


def main(args: argparse.Namespace) -> int:
    """Publish until the number of times is reached, or Ctrl-C."""
    times = 1 if args.once else args.times
    wanted = args.wait_matching_subscriptions
    if wanted is None:
        wanted = 1 if times else 0
    message_class = load_type(args.message_type, "message")
    values = parse_values(args.values)
    with command_node(args.use_sim_time, args.node_name) as node:
        message = message_class()
        fill_message(message, values, lambda: node.get_clock().now().to_msg())
        topic = full_name(node, args.topic_name)
        publisher = node.create_publisher(message_class, topic, profile_from_flags(args))
        _wait_for_subscriptions(node, publisher, wanted, args.max_wait_time_secs)
        print("publisher: beginning loop", flush=True)
        count = 0
        next_time = time.monotonic()
        while times == 0 or count < times:
            count += 1
            if count > 1:
                fill_message(message, values, lambda: node.get_clock().now().to_msg())
            publisher.publish(message)
            if args.print and count % args.print == 0:
                print(f"publishing #{count}: {message!r}\n", flush=True)
            next_time += 1.0 / args.rate
            if count != times:
                spin_until(node, lambda: False, max(0.0, next_time - time.monotonic()))
        if times:
            time.sleep(args.keep_alive)  # the message is on the wire before the publisher goes
    return 0


def _wait_for_subscriptions(node: Any, publisher: Any, wanted: int, timeout: float | None) -> None:
    deadline = None if timeout is None else time.monotonic() + timeout
    while not spin_until(node, lambda: publisher.get_subscription_count() >= wanted, 1.0):
        if deadline is not None and time.monotonic() >= deadline:
            raise CommandError(f"Timed out waiting for subscribers: Expected {wanted} subscribers")
        print(f"Waiting for at least {wanted} matching subscription(s)...", flush=True)
