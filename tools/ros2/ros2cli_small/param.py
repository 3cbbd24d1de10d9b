"""ros2 param list, get and set: the parameters of running nodes."""

from __future__ import annotations

import argparse
import re
import sys
import time
from typing import TYPE_CHECKING, Any

from ros2cli_small.discovery import wait_for_graph
from ros2cli_small.errors import CommandError
from ros2cli_small.graph import add_node_arguments, call_service, command_node, wait_until_found
from ros2cli_small.node_list import node_names

if TYPE_CHECKING:
    from rclpy.node import Node

# In the order of rcl_interfaces/msg/ParameterType: how a type is called, what precedes a value, and its field.
_TYPES = (
    ("not set", "Parameter not set.", None),
    ("boolean", "Boolean value is:", "bool_value"),
    ("integer", "Integer value is:", "integer_value"),
    ("double", "Double value is:", "double_value"),
    ("string", "String value is:", "string_value"),
    ("byte array", "Byte values are:", "byte_array_value"),
    ("boolean array", "Boolean values are:", "bool_array_value"),
    ("integer array", "Integer values are:", "integer_array_value"),
    ("double array", "Double values are:", "double_array_value"),
    ("string array", "String values are:", "string_array_value"),
)


def add_parsers(verbs: Any) -> None:
    """Add `param get`, `list` and `set` to the command line."""
    get = verbs.add_parser("get", help="Get parameter")
    _add_common_arguments(get)
    get.add_argument("node_name", help="Name of the ROS node")
    get.add_argument("parameter_name", help="Name of the parameter")
    get.add_argument("--hide-type", action="store_true", help="Hide the type information")
    get.set_defaults(main=get_parameter)

    listing = verbs.add_parser("list", help="Output a list of available parameters")
    _add_common_arguments(listing, timeout=False)
    listing.add_argument("node_name", nargs="?", help="Name of the ROS node, by default all")
    listing.add_argument(
        "--param-prefixes", nargs="+", default=[], metavar="PREFIX", help="Only list parameters with these prefixes"
    )
    listing.add_argument("--param-type", action="store_true", help="Print parameter types with parameter names")
    listing.add_argument("--filter", metavar="REGEX", help="Only list parameters that match the regular expression")
    listing.set_defaults(main=list_parameters)

    setting = verbs.add_parser("set", help="Set parameter")
    _add_common_arguments(setting)
    setting.add_argument("node_name", help="Name of the ROS node")
    setting.add_argument("parameter_name", help="Name of the parameter")
    setting.add_argument("value", help="Value of the parameter, as YAML")
    setting.set_defaults(main=set_parameter)


def _add_common_arguments(parser: argparse.ArgumentParser, timeout: bool = True) -> None:
    add_node_arguments(parser)
    parser.add_argument("--include-hidden-nodes", action="store_true", help="Consider hidden nodes as well")
    if timeout:
        parser.add_argument(
            "--timeout", metavar="N", type=int, default=1, help="Wait at least N seconds for the node (default: 1)"
        )


def get_parameter(args: argparse.Namespace) -> int:
    """Print one parameter's value."""
    from rcl_interfaces.srv import GetParameters

    with command_node(args.use_sim_time) as node:
        name = _find_node(node, args)
        request = GetParameters.Request(names=[args.parameter_name])
        values = call_service(node, GetParameters, f"{name}/get_parameters", request).values
    if not values:
        raise CommandError("Parameter not set")
    _, label, field = _TYPES[values[0].type]
    value = None if field is None else getattr(values[0], field)
    if args.hide_type:
        print(value)
    elif value is None:
        print(label)
    else:
        print(label, value)
    return 0


def set_parameter(args: argparse.Namespace) -> int:
    """Set one parameter; a node that refuses is quoted, with exit status 0 as the real command has."""
    from rcl_interfaces.msg import Parameter
    from rcl_interfaces.srv import SetParameters
    from rclpy.parameter import get_parameter_value

    parameter = Parameter(name=args.parameter_name, value=get_parameter_value(args.value))
    with command_node(args.use_sim_time) as node:
        name = _find_node(node, args)
        request = SetParameters.Request(parameters=[parameter])
        (result,) = call_service(node, SetParameters, f"{name}/set_parameters", request).results
    outcome = "Set parameter successful" if result.successful else "Setting parameter failed"
    reason = f": {result.reason}" if result.reason else ""
    print(outcome + reason, file=sys.stdout if result.successful else sys.stderr)
    return 0


def list_parameters(args: argparse.Namespace) -> int:
    """Print the parameters' names, of one node or of all."""
    pattern = _regex(args.filter)
    with command_node(args.use_sim_time) as node:
        if args.node_name:
            names = [_find_node(node, args)]
        else:
            wait_for_graph(node, args.spin_time)
            services = dict(node.get_service_names_and_types())
            names = [
                name for name in node_names(node, args.include_hidden_nodes) if f"{name}/list_parameters" in services
            ]
        for name in names:
            if not args.node_name:
                print(f"{name}:")
            try:
                lines = _parameter_lines(node, name, args)
            except CommandError as error:
                if args.node_name:
                    raise
                print(f"Exception while calling service of node '{name}': {error}", file=sys.stderr)
                continue
            for parameter, line in lines:
                if pattern is None or pattern.search(parameter):
                    print(f"  {line}")
    return 0


def _parameter_lines(node: Node, name: str, args: argparse.Namespace) -> list[tuple[str, str]]:
    """Return a node's parameters, each with its line."""
    from rcl_interfaces.srv import DescribeParameters, ListParameters

    request = ListParameters.Request(prefixes=args.param_prefixes)
    found = sorted(call_service(node, ListParameters, f"{name}/list_parameters", request).result.names)
    if not args.param_type:
        return [(parameter, parameter) for parameter in found]
    described = call_service(
        node, DescribeParameters, f"{name}/describe_parameters", DescribeParameters.Request(names=found)
    )
    return [(each.name, f"{each.name} (type: {_TYPES[each.type][0]})") for each in described.descriptors]


def _find_node(node: Node, args: argparse.Namespace) -> str:
    """Return the full name of the node that is asked for, once it is there."""
    name = str(args.node_name) if args.node_name.startswith("/") else f"/{args.node_name}"
    deadline = time.monotonic() + getattr(args, "timeout", 0)
    while not wait_until_found(node, lambda: name in node_names(node, args.include_hidden_nodes), args.spin_time):
        if time.monotonic() >= deadline:
            raise CommandError("Node not found")
    return name


def _regex(text: str | None) -> re.Pattern[str] | None:
    try:
        return None if text is None else re.compile(text)
    except re.error as error:
        raise CommandError(f"'{text}' is no regular expression: {error}") from None
