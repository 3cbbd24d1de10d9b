"""ros2 service call: send a request and print the response."""

from __future__ import annotations

import argparse
import time
from typing import Any

from ros2cli_small.errors import CommandError
from ros2cli_small.graph import command_node, full_name, load_type, spin_until
from ros2cli_small.message_values import fill_message, parse_values
from ros2cli_small.topic_pub import positive_float


def add_parser(verbs: Any) -> None:
    """Add `service call` to the command line."""
    parser = verbs.add_parser("call", help="Call a service")
    parser.add_argument("service_name", help="Name of the ROS service to call to (e.g. '/add_two_ints')")
    parser.add_argument("service_type", help="Type of the ROS service (e.g. 'std_srvs/srv/Empty')")
    parser.add_argument(
        "values", nargs="?", default="{}", help="Values to fill the service request with in YAML format"
    )
    parser.add_argument(
        "-r", "--rate", metavar="N", type=positive_float, help="Repeat the call at a specific rate in Hz"
    )
    parser.set_defaults(main=main)


def main(args: argparse.Namespace) -> int:
    """Call once, or at a rate until Ctrl-C."""
    service_class = load_type(args.service_type, "service")
    values = parse_values(args.values)
    request = service_class.Request()
    with command_node() as node:
        fill_message(request, values, lambda: node.get_clock().now().to_msg())
        client = node.create_client(service_class, full_name(node, args.service_name))
        if not spin_until(node, client.service_is_ready, 0.2):
            print("waiting for service to become available...", flush=True)
            spin_until(node, client.service_is_ready)
        while True:
            print(f"requester: making request: {request!r}\n", flush=True)
            started = time.monotonic()
            future = client.call_async(request)
            spin_until(node, future.done)
            if future.exception() is not None:
                raise CommandError(f"Exception while calling service: {future.exception()!r}")
            print(f"response:\n{future.result()!r}\n", flush=True)
            if args.rate is None:
                return 0
            spin_until(node, lambda: False, max(0.0, started + 1.0 / args.rate - time.monotonic()))
