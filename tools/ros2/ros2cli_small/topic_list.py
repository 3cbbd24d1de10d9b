"""ros2 topic list: the topics that somebody publishes or subscribes."""

from __future__ import annotations

import argparse
from typing import Any

from ros2cli_small.discovery import wait_for_graph
from ros2cli_small.graph import add_node_arguments, command_node, is_hidden


def add_parser(verbs: Any) -> None:
    """Add `topic list` to the command line."""
    parser = verbs.add_parser("list", help="Output a list of available topics")
    add_node_arguments(parser)
    parser.add_argument("-t", "--show-types", action="store_true", help="Additionally show the topic type")
    parser.add_argument(
        "-c", "--count-topics", action="store_true", help="Only display the number of topics discovered"
    )
    parser.add_argument("--include-hidden-topics", action="store_true", help="Consider hidden topics as well")
    parser.set_defaults(main=main)


def main(args: argparse.Namespace) -> int:
    """Print one topic a line."""
    with command_node(args.use_sim_time) as node:
        wait_for_graph(node, args.spin_time)
        found = sorted(node.get_topic_names_and_types())
    topics = [(name, types) for name, types in found if args.include_hidden_topics or not is_hidden(name)]
    if args.count_topics:
        print(len(topics))
        return 0
    for name, types in topics:
        print(f"{name} [{', '.join(types)}]" if args.show_types else name)
    return 0
