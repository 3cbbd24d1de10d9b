"""ros2 topic info: a topic's type and how many publish and subscribe it."""

from __future__ import annotations

import argparse
from typing import Any

from ros2cli_small.discovery import wait_for_graph
from ros2cli_small.errors import CommandError
from ros2cli_small.graph import add_node_arguments, command_node, full_name, topic_types


def add_parser(verbs: Any) -> None:
    """Add `topic info` to the command line."""
    parser = verbs.add_parser("info", help="Print information about a topic")
    add_node_arguments(parser)
    parser.add_argument("topic_name", help="Name of the ROS topic to get info (e.g. '/chatter')")
    parser.add_argument(
        "-v",
        "--verbose",
        action="store_true",
        help="Show node, type, identifier and QoS of each publisher and subscriber",
    )
    parser.set_defaults(main=main)


def main(args: argparse.Namespace) -> int:
    """Print type and counts; with --verbose every endpoint."""
    with command_node(args.use_sim_time) as node:
        wait_for_graph(node, args.spin_time)
        topic = full_name(node, args.topic_name)
        types = topic_types(node, topic)
        if not types:
            raise CommandError(f"Unknown topic '{args.topic_name}'")
        publishers = node.get_publishers_info_by_topic(topic)
        subscribers = node.get_subscriptions_info_by_topic(topic)
    end = "\n\n" if args.verbose else "\n"
    print(f"Type: {types[0] if len(types) == 1 else types}", end=end)
    for title, endpoints in (("Publisher count", publishers), ("Subscription count", subscribers)):
        print(f"{title}: {len(endpoints)}", end=end)
        for endpoint in endpoints if args.verbose else ():
            print(endpoint, end=end)
    return 0
