"""A node for the length of one command, and what it sees of the graph."""

from __future__ import annotations

import argparse
import os
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from ros2cli_small.discovery import PATIENCE, QUIET_TIME, GraphWatch
from ros2cli_small.errors import CommandError

if TYPE_CHECKING:
    from rclpy.node import Node

POLL_PERIOD = 0.05  # s
SERVICE_TIMEOUT = 10.0  # s, for a service to be found, and to answer
_TYPE_FOLDERS = {"message": "msg", "service": "srv", "action": "action"}


def add_node_arguments(parser: argparse.ArgumentParser, daemon: bool = True) -> None:
    """Add the flags that the real command's node takes; `--no-daemon` only where the real command would ask its own."""
    parser.add_argument(
        "--spin-time",
        type=float,
        metavar="SECONDS",
        help="Wait this long for discovery; by default until every participant of this machine has answered and "
        f"nothing new came for {QUIET_TIME:g} s, or {PATIENCE:g} s where one does not answer",
    )
    parser.add_argument("-s", "--use-sim-time", action="store_true", help="Enable ROS simulation time")
    if daemon:
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


def is_hidden(topic: str) -> bool:
    """Return True if a part of the name starts with an underscore, as the topics of actions do."""
    return any(part.startswith("_") for part in topic.split("/"))


def wait_until_found(node: Node, found: Callable[[], object], spin_time: float | None) -> bool:
    """Wait for something in the graph until that is complete or `spin_time` seconds passed; tell whether it came."""
    watch = GraphWatch(node)
    deadline = None if spin_time is None else time.monotonic() + spin_time
    while not found():
        over = watch.complete() if deadline is None else time.monotonic() >= deadline
        if over:
            return bool(found())
        time.sleep(POLL_PERIOD)
    return True


def wait_for_topic_type(node: Node, topic: str, spin_time: float | None) -> str | None:
    """Return a topic's type once somebody offers it, or None when the wait is over."""
    wait_until_found(node, lambda: topic_types(node, topic), spin_time)
    types = topic_types(node, topic)
    if len(types) > 1:
        raise CommandError(f"Cannot echo topic '{topic}', as it contains more than one type: [{', '.join(types)}]")
    return types[0] if types else None


def load_type(name: str, kind: str) -> Any:
    """Return the Python class of `package/folder/Name`; the short form `package/Name` will do.

    `kind` is message, service or action.
    """
    import importlib

    wanted = _TYPE_FOLDERS[kind]
    parts = name.split("/")
    if len(parts) == 2:
        parts.insert(1, wanted)
    if len(parts) != 3 or not all(parts) or parts[1] != wanted:
        raise CommandError(f"The passed {kind} type is invalid")
    try:
        return getattr(importlib.import_module(f"{parts[0]}.{parts[1]}"), parts[2])
    except (ImportError, AttributeError):
        raise CommandError(f"The passed {kind} type is invalid") from None


def call_service(node: Node, service_class: Any, name: str, request: Any) -> Any:
    """Return a service's response; one that is not there or does not answer in time is an error."""
    client = node.create_client(service_class, name)
    try:
        if not spin_until(node, client.service_is_ready, SERVICE_TIMEOUT):
            raise CommandError(f"Wait for service '{name}' timed out")
        future = client.call_async(request)
        if not spin_until(node, future.done, SERVICE_TIMEOUT):
            raise CommandError(f"Service '{name}' did not answer within {SERVICE_TIMEOUT:g} s")
        if future.exception() is not None:
            raise CommandError(f"Exception while calling service: {future.exception()!r}")
        return future.result()
    finally:
        node.destroy_client(client)
