"""ros2 action list, info and send_goal."""

from __future__ import annotations

import argparse
import signal
import time
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any
from uuid import uuid4

from ros2cli_small.discovery import wait_for_graph
from ros2cli_small.errors import CommandError
from ros2cli_small.graph import command_node, full_name, load_type, spin_until
from ros2cli_small.message_values import Shortening, fill_message, parse_values, to_yaml
from ros2cli_small.node_list import node_names

if TYPE_CHECKING:
    from collections.abc import Iterator

    from rclpy.node import Node
    from unique_identifier_msgs.msg import UUID

CANCEL_TIME = 30.0  # s, at most, for the server to answer that it cancels
POLL_PERIOD = 0.05  # s
FEEDBACK_TIME = 0.3  # s, for the server to hear of a subscription, and for feedback that a result overtook
_WHOLE = Shortening(length=None)
# In the order of action_msgs/msg/GoalStatus.
_STATUSES = ("UNKNOWN", "ACCEPTED", "EXECUTING", "CANCELING", "SUCCEEDED", "CANCELED", "ABORTED")


def add_parsers(verbs: Any) -> None:
    """Add `action info`, `list` and `send_goal` to the command line."""
    info = verbs.add_parser("info", help="Print information about an action")
    info.add_argument("action_name", help="Name of the ROS action to get info (e.g. '/fibonacci')")
    info.add_argument("-t", "--show-types", action="store_true", help="Additionally show the action type")
    info.add_argument("-c", "--count", action="store_true", help="Only display the number of clients and servers")
    info.set_defaults(main=show_info)

    listing = verbs.add_parser("list", help="Output a list of action names")
    listing.add_argument("-t", "--show-types", action="store_true", help="Additionally show the action type")
    listing.add_argument("-c", "--count-actions", action="store_true", help="Only display the number of actions")
    listing.set_defaults(main=list_actions)

    send = verbs.add_parser("send_goal", help="Send an action goal")
    send.add_argument("action_name", help="Name of the ROS action (e.g. '/fibonacci')")
    send.add_argument("action_type", help="Type of the ROS action (e.g. 'example_interfaces/action/Fibonacci')")
    send.add_argument("goal", nargs="?", default="{}", help="Goal request values in YAML format (e.g. '{order: 10}')")
    send.add_argument("-f", "--feedback", action="store_true", help="Echo feedback messages for the goal")
    send.set_defaults(main=send_goal)


def list_actions(args: argparse.Namespace) -> int:
    """Print one action a line."""
    from rclpy.action import get_action_names_and_types

    with command_node() as node:
        wait_for_graph(node)
        actions = sorted(get_action_names_and_types(node))
    if args.count_actions:
        print(len(actions))
        return 0
    for name, types in actions:
        print(f"{name} [{', '.join(types)}]" if args.show_types else name)
    return 0


def show_info(args: argparse.Namespace) -> int:
    """Print which nodes serve an action and which use it."""
    from rclpy.action import get_action_client_names_and_types_by_node, get_action_server_names_and_types_by_node

    with command_node() as node:
        wait_for_graph(node)
        action = full_name(node, args.action_name)
        clients = _nodes_with(node, action, get_action_client_names_and_types_by_node)
        servers = _nodes_with(node, action, get_action_server_names_and_types_by_node)
    print(f"Action: {args.action_name}")
    for title, found in (("Action clients", clients), ("Action servers", servers)):
        print(f"{title}: {len(found)}")
        for name, types in [] if args.count else found:
            print(f"    {name} [{', '.join(types)}]" if args.show_types else f"    {name}")
    return 0


def _nodes_with(node: Node, action: str, actions_of_node: Any) -> list[tuple[str, list[str]]]:
    """Return the nodes that `actions_of_node` says to have the action, each with the action's types there."""
    found = []
    for name in node_names(node):
        space, _, base = name.rpartition("/")
        types = dict(actions_of_node(node, base, space or "/")).get(action)
        if types:
            found.append((name, types))
    return found


def send_goal(args: argparse.Namespace) -> int:
    """Send a goal and print its result; Ctrl-C cancels it."""
    from rclpy.action import ActionClient

    action_class = load_type(args.action_type, "action")
    goal = action_class.Goal()
    values = parse_values(args.goal)
    with command_node() as node:
        fill_message(goal, values, lambda: node.get_clock().now().to_msg())
        name = full_name(node, args.action_name)
        client = ActionClient(node, action_class, name)
        try:
            goal_id = _feedback_of_a_goal(node, action_class, name) if args.feedback else None
            return _follow(node, client, goal, goal_id)
        finally:
            client.destroy()


def _feedback_of_a_goal(node: Node, action_class: Any, action: str) -> UUID:
    """Return the ID of a goal whose feedback is printed from now on.

    rclpy's own callback ends with the goal's result, which can overtake the last feedback.
    """
    from unique_identifier_msgs.msg import UUID

    goal_id = UUID(uuid=list(uuid4().bytes))

    def show(message: Any) -> None:
        if message.goal_id == goal_id:
            print(f"Feedback:\n    {to_yaml(message.feedback, _WHOLE)}", flush=True)

    node.create_subscription(action_class.Impl.FeedbackMessage, f"{action}/_action/feedback", show, 10)
    return goal_id


def _follow(node: Node, client: Any, goal: Any, goal_id: UUID | None) -> int:
    """Send a goal and print how it ends. goal_id: where feedback of it is printed, too."""
    print("Waiting for an action server to become available...", flush=True)
    while not client.server_is_ready():
        time.sleep(POLL_PERIOD)
    if goal_id is not None:
        time.sleep(FEEDBACK_TIME)
    print(f"Sending goal:\n     {to_yaml(goal, _WHOLE)}", flush=True)
    with _first_interrupt_noted() as interrupted:
        sent = client.send_goal_async(goal, goal_uuid=goal_id)
        spin_until(node, sent.done)
        handle = _result_of(sent)
        if not handle.accepted:
            print("Goal was rejected.")
            return 0
        print(f"Goal accepted with ID: {bytes(handle.goal_id.uuid).hex()}\n", flush=True)
        finished = handle.get_result_async()
        spin_until(node, lambda: finished.done() or bool(interrupted))
        if not finished.done():
            _cancel(node, handle)
            return int(signal.SIGINT)
    if goal_id is not None:
        spin_until(node, lambda: False, FEEDBACK_TIME)
    result = _result_of(finished)
    print(f"Result:\n    {to_yaml(result.result, _WHOLE)}")
    print(f"Goal finished with status: {_STATUSES[result.status]}")
    return 0


@contextmanager
def _first_interrupt_noted() -> Iterator[list[int]]:
    """Yield a list that the first Ctrl-C is written to; the second one interrupts.

    An exception in the middle of rclpy's callbacks can lose the message that they handle, and with it the cancel.
    """
    seen: list[int] = []

    def note(number: int, _frame: Any) -> None:
        seen.append(number)
        signal.signal(signal.SIGINT, signal.default_int_handler)

    before = signal.signal(signal.SIGINT, note)
    try:
        yield seen
    finally:
        signal.signal(signal.SIGINT, before)


def _result_of(future: Any) -> Any:
    if future.exception() is not None:
        raise CommandError(f"Exception while waiting for the action server: {future.exception()!r}")
    return future.result()


def _cancel(node: Node, handle: Any) -> None:
    """Cancel an accepted goal, and say whether the server does."""
    print("Canceling goal...", flush=True)
    answer = handle.cancel_goal_async()
    if not spin_until(node, answer.done, CANCEL_TIME) or not answer.result().goals_canceling:
        raise CommandError("Failed to cancel goal")
    print("Goal canceled.", flush=True)
