"""A node for the length of one command, and what it sees of the graph."""

from __future__ import annotations

import argparse
import os
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from ros2cli_small.errors import CommandError

if TYPE_CHECKING:
    from rclpy.node import Node

DISCOVERY_TIMEOUT = 3.0  # s; nodes on one machine find each other in less than 1
POLL_PERIOD = 0.05  # s


def add_node_arguments(parser: argparse.ArgumentParser, spin_time: float = DISCOVERY_TIMEOUT) -> None:
    """Add the flags that the real command's node takes."""
    parser.add_argument(
        "--spin-time",
        type=float,
        default=spin_time,
        help=f"Spin time in seconds to wait for discovery (default: {spin_time:g})",
    )
    parser.add_argument("-s", "--use-sim-time", action="store_true", help="Enable ROS simulation time")
    parser.add_argument("--no-daemon", action="store_true", help="Do not use the daemon; there is none here")


@contextmanager
def command_node(use_sim_time: bool = False, name: str | None = None, remappings: Sequence[str] = ()) -> Iterator[Node]:
    """Yield a node, with `old:=new` remappings. Ctrl-C stays Python's, so that every command ends in one place."""
    import rclpy
    from rclpy.parameter import Parameter
    from rclpy.signals import SignalHandlerOptions

    rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
    try:
        node = rclpy.create_node(
            name or f"_ros2cli_{os.getpid()}",
            cli_args=["--ros-args", *(part for rule in remappings for part in ("-r", rule))],
            start_parameter_services=False,
            parameter_overrides=[Parameter("use_sim_time", value=True)] if use_sim_time else [],
        )
        try:
            yield node
        finally:
            node.destroy_node()
    finally:
        rclpy.shutdown()


def spin_until(node: Node, condition: Callable[[], bool], timeout: float | None = None) -> bool:
    """Spin until the condition holds (True) or the time is over (False)."""
    import rclpy

    deadline = None if timeout is None else time.monotonic() + timeout
    while not condition():
        if deadline is not None and time.monotonic() >= deadline:
            return False
        rclpy.spin_once(node, timeout_sec=POLL_PERIOD)
    return True


def full_name(node: Node, name: str) -> str:
    """Return the topic or service name with its namespace."""
    from rclpy.exceptions import InvalidServiceNameException, InvalidTopicNameException
    from rclpy.expand_topic_name import expand_topic_name
    from rclpy.validate_full_topic_name import validate_full_topic_name

    try:
        expanded = expand_topic_name(name, node.get_name(), node.get_namespace())
        validate_full_topic_name(expanded)
    except (ValueError, InvalidTopicNameException, InvalidServiceNameException) as error:
        raise CommandError(str(error)) from None
    return str(expanded)


def topic_types(node: Node, topic: str) -> list[str]:
    """Return the types that a topic is known with now; empty when nobody offers it."""
    return next((list(types) for name, types in node.get_topic_names_and_types() if name == topic), [])


def wait_for_topic_type(node: Node, topic: str, timeout: float | None) -> str | None:
    """Return a topic's type once somebody offers it, or None after the time-out."""
    spin_until(node, lambda: bool(topic_types(node, topic)), timeout)
    types = topic_types(node, topic)
    if len(types) > 1:
        raise CommandError(f"Cannot echo topic '{topic}', as it contains more than one type: [{', '.join(types)}]")
    return types[0] if types else None


def load_type(name: str, kind: str) -> Any:
    """Return the Python class of `package/kind/Name`; the short form `package/Name` will do."""
    import importlib

    parts = name.split("/")
    if len(parts) == 2:
        parts.insert(1, "msg" if kind == "message" else "srv")
    wanted = "msg" if kind == "message" else "srv"
    if len(parts) != 3 or not all(parts) or parts[1] != wanted:
        raise CommandError(f"The passed {kind} type is invalid")
    try:
        return getattr(importlib.import_module(f"{parts[0]}.{parts[1]}"), parts[2])
    except (ImportError, AttributeError):
        raise CommandError(f"The passed {kind} type is invalid") from None
