"""ros2 topic echo: print the messages of a topic."""

from __future__ import annotations

import argparse
from typing import Any

from ros2cli_small.errors import CommandError
from ros2cli_small.graph import (
    add_node_arguments,
    command_node,
    full_name,
    load_type,
    spin_until,
    wait_for_topic_type,
    wait_until_found,
)
from ros2cli_small.message_values import Shortening, to_csv, to_yaml
from ros2cli_small.qos import add_qos_arguments, subscriber_profile

DEFAULT_LENGTH = 128


def add_parser(verbs: Any) -> None:
    """Add `topic echo` to the command line."""
    parser = verbs.add_parser("echo", help="Output messages from a topic")
    add_node_arguments(parser)
    parser.add_argument("topic_name", help="Name of the ROS topic to listen to (e.g. '/chatter')")
    parser.add_argument("message_type", nargs="?", help="Type of the ROS message (e.g. 'std_msgs/msg/String')")
    add_qos_arguments(parser, "sensor_data")
    parser.add_argument("--csv", action="store_true", help="Output all recursive fields separated by commas")
    parser.add_argument("--field", metavar="FIELD", help="Echo a selected field of a message")
    parser.add_argument("-f", "--full-length", action="store_true", help="Output all elements of arrays and strings")
    parser.add_argument(
        "-l", "--truncate-length", type=int, default=DEFAULT_LENGTH, metavar="N",
        help=f"The length to truncate arrays, bytes, and string to (default: {DEFAULT_LENGTH})",
    )  # fmt: skip
    parser.add_argument("--no-arr", action="store_true", help="Don't print array fields of messages")
    parser.add_argument("--no-str", action="store_true", help="Don't print string fields of messages")
    parser.add_argument("--flow-style", action="store_true", help="Print collections in the block style")
    parser.add_argument("--once", action="store_true", help="Print the first message received and then exit")
    parser.set_defaults(main=main)


def select_field(message: Any, path: str | None) -> Any:
    """Return the part of a message that a dotted path names, such as `pose.position` or `points[0].x`."""
    for part in (path or "").split(".") if path else []:
        name, *indices = part.replace("]", "").split("[")
        try:
            message = getattr(message, name)
            for index in indices:
                message = message[int(index)]
        except (AttributeError, IndexError, TypeError, ValueError):
            raise CommandError(f"Invalid field '{path}': no '{part}' in {type(message).__name__}") from None
    return message


def main(args: argparse.Namespace) -> int:
    """Print messages until the first one (--once) or Ctrl-C."""
    shortening = Shortening(None if args.full_length else args.truncate_length, args.no_arr, args.no_str)
    printed = 0
    failure: CommandError | None = None

    def show(message: Any) -> None:
        nonlocal printed, failure
        if args.once and printed:
            return
        printed += 1
        try:
            selected = select_field(message, args.field)
        except CommandError as error:
            failure = error
            return
        if args.csv:
            print(to_csv(selected, shortening), flush=True)
        else:
            print(to_yaml(selected, shortening, args.flow_style) + "---", flush=True)

    with command_node(args.use_sim_time) as node:
        topic = full_name(node, args.topic_name)
        # Even with the type given: the publishers' QoS is what the subscription is to fit.
        wait_until_found(node, lambda: node.count_publishers(topic), args.spin_time)
        kind = args.message_type or wait_for_topic_type(node, topic, 0.0)
        if kind is None:
            print(f"WARNING: topic [{topic}] does not appear to be published yet")
            raise CommandError("Could not determine the type for the passed topic")
        message_class = load_type(kind, "message")
        node.create_subscription(message_class, topic, show, subscriber_profile(node, topic, args))
        spin_until(node, lambda: failure is not None or (args.once and printed > 0))
    if failure is not None:
        raise failure
    return 0
