"""ros2 node list: the nodes of the graph."""

from __future__ import annotations

import argparse
import sys
from typing import TYPE_CHECKING, Any

from ros2cli_small.discovery import wait_for_graph
from ros2cli_small.graph import add_node_arguments, command_node

if TYPE_CHECKING:
    from rclpy.node import Node


def add_parser(verbs: Any) -> None:
    """Add `node list` to the command line."""
    parser = verbs.add_parser("list", help="Output a list of available nodes")
    add_node_arguments(parser)
    parser.add_argument("-a", "--all", action="store_true", help="Display all nodes even hidden ones")
    parser.add_argument("-c", "--count-nodes", action="store_true", help="Only display the number of nodes discovered")
    parser.set_defaults(main=main)


def node_names(node: Node, hidden: bool = False) -> list[str]:
    """Return the full names of the nodes seen now, sorted; those that begin with an underscore only with `hidden`."""
    found = node.get_node_names_and_namespaces()
    return sorted(f"{space.rstrip('/')}/{name}" for name, space in found if hidden or not name.startswith("_"))


def main(args: argparse.Namespace) -> int:
    """Print one node a line."""
    with command_node(args.use_sim_time) as node:
        wait_for_graph(node, args.spin_time)
        names = node_names(node, args.all)
    if args.count_nodes:
        print(len(names))
        return 0
    if len(set(names)) < len(names):
        print("WARNING: some nodes have the same name, which can have unintended effects", file=sys.stderr)
    for name in names:
        print(name)
    return 0
