"""The command line: groups and verbs, and what becomes of errors."""

from __future__ import annotations

import argparse
import os
import signal
import sys
from typing import Any

from ros2cli_small import (
    action,
    interface_show,
    launch,
    node_list,
    param,
    run,
    service_call,
    topic_echo,
    topic_hz,
    topic_info,
    topic_list,
    topic_pub,
)
from ros2cli_small.bag import info as bag_info
from ros2cli_small.bag import play as bag_play
from ros2cli_small.bag import record as bag_record
from ros2cli_small.errors import CommandError


def build_parser() -> argparse.ArgumentParser:
    """Return the parser; each verb's module adds its own arguments and sets `main`."""
    parser = argparse.ArgumentParser(prog="ros2", description="ros2 is a command-line tool for ROS 2.")
    commands = parser.add_subparsers(title="Commands", metavar="command")
    run.add_parser(commands)
    launch.add_parser(commands)

    action.add_parsers(_add_group(commands, "action", "Various action related sub-commands"))
    bag = _add_group(commands, "bag", "Various rosbag related sub-commands")
    for bag_verb in (bag_info, bag_play, bag_record):
        bag_verb.add_parser(bag)
    interface_show.add_parser(_add_group(commands, "interface", "Show information about ROS interfaces"))
    node_list.add_parser(_add_group(commands, "node", "Various node related sub-commands"))
    param.add_parsers(_add_group(commands, "param", "Various param related sub-commands"))
    service_call.add_parser(_add_group(commands, "service", "Various service related sub-commands"))
    topic = _add_group(commands, "topic", "Various topic related sub-commands")
    for verb in (topic_echo, topic_hz, topic_info, topic_list, topic_pub):
        verb.add_parser(topic)
    return parser


def _add_group(commands: Any, name: str, text: str) -> Any:
    """Return what a group's verbs are added to."""
    group = commands.add_parser(name, help=text)
    group.set_defaults(group=group)
    return group.add_subparsers(title="Commands", metavar="verb")


def main(argv: list[str] | None = None) -> int:
    """Run the command and return its exit status: 0, 1 for an error, 2 for wrong usage or Ctrl-C."""
    # The package of ROS's messages also imports, where it can, what generates messages, and a parser for that: a fifth
    # of a short command's time. No command generates any.
    sys.modules.setdefault("rosidl_generator_py.generate_py_impl", None)  # type: ignore[arg-type]
    parser = build_parser()
    args = parser.parse_args(argv)
    verb = getattr(args, "main", None)
    if verb is None:
        getattr(args, "group", parser).print_help()
        return 0
    # A shell ignores Ctrl-C for what it starts in the background, and that is inherited: a signal sent on purpose
    # must end the command all the same.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        return int(verb(args))
    except KeyboardInterrupt:
        return int(signal.SIGINT)
    except CommandError as error:
        print(error, file=sys.stderr)
        return 1
    except BrokenPipeError:  # the reader of our output is gone, as in `| head`
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1
