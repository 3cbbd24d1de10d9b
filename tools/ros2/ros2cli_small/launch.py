"""ros2 launch: start what a YAML launch file describes."""

from __future__ import annotations

import argparse
import os
import sys
from datetime import datetime
from pathlib import Path
from typing import Any

from ros2cli_small.errors import CommandError
from ros2cli_small.launch_file import Argument, LaunchDescription
from ros2cli_small.packages import find_share


def add_parser(commands: Any) -> None:
    """Add `launch` to the command line."""
    parser = commands.add_parser("launch", help="Run a launch file")
    parser.add_argument(
        "-n",
        "--noninteractive",
        action="store_true",
        help="Run the launch system non-interactively, with no terminal",
    )
    parser.add_argument(
        "-s", "--show-args", "--show-arguments", action="store_true",
        help="Show arguments that may be given to the launch file.",
    )  # fmt: skip
    parser.add_argument("package_name", help="Name of the ROS package which contains the launch file")
    parser.add_argument("launch_file_name", nargs="?", help="Name of the launch file")
    parser.add_argument("launch_arguments", nargs="*", help="Arguments to the launch file; '<name>:=<value>'")
    parser.set_defaults(main=main)


def find_launch_file(package: str, name: str | None) -> Path:
    """Return the file that a package and a name, or a path alone, stand for."""
    if name is None:
        if Path(package).is_file():
            return Path(package).absolute()
        raise CommandError(f"No launch file supplied, and '{package}' is not a file")
    share = find_share(package)
    found = sorted(path for path in share.rglob(name) if path.is_file())
    if not found:
        raise CommandError(f"file '{name}' was not found in the share directory of package '{package}' at '{share}'")
    if len(found) > 1:
        raise CommandError(f"file '{name}' was found more than once in the share directory of package '{package}'")
    return found[0]


def parse_arguments(texts: list[str]) -> dict[str, str]:
    """Return the values of '<name>:=<value>' texts."""
    values = {}
    for text in texts:
        name, separator, value = text.partition(":=")
        if not name or not separator:
            raise CommandError(f"malformed launch argument '{text}', expected format '<name>:=<value>'")
        values[name] = value
    return values


def show(arguments: list[Argument]) -> None:
    """Print what may be given to the launch file."""
    print("Arguments (pass arguments as '<name>:=<value>'):")
    if not arguments:
        print("\n  No arguments.")
    shown: set[str] = set()
    for argument in arguments:
        if argument.name in shown:  # an included file's, which the outer one passes on
            continue
        shown.add(argument.name)
        valid = f"  Valid choices are: {list(argument.choices)}" if argument.choices else ""
        print(f"\n    '{argument.name}':\n        {argument.description or 'no description given'}{valid}")
        if argument.default is not None:
            print(f"        (default: '{argument.default}')")


def log_folder() -> Path:
    """Return a new folder for this launch's log, where ROS keeps its logs."""
    home = Path(os.environ.get("ROS_HOME") or Path.home() / ".ros")
    base = Path(os.environ.get("ROS_LOG_DIR") or home / "log")
    name = f"{datetime.now():%Y-%m-%d-%H-%M-%S-%f}-{os.uname().nodename}-{os.getpid()}"
    try:
        (base / name).mkdir(parents=True)
    except OSError as error:
        raise CommandError(f"cannot write logs: {error}") from None
    return base / name


def main(args: argparse.Namespace) -> int:
    """Run the launch file; the exit status tells of the file, not of its processes."""
    name, texts = args.launch_file_name, list(args.launch_arguments)
    if name is not None and ":=" in name:  # a path alone, then arguments
        name, texts = None, [name, *texts]
    path = find_launch_file(args.package_name, name)
    description = LaunchDescription(parse_arguments(texts), declarations_only=args.show_args)
    if args.show_args:
        description.load(path)
        show(description.arguments)
        return 0
    import asyncio  # slow to import, and no other verb needs it

    from ros2cli_small.launch_service import LaunchLog, LaunchService

    folder = log_folder()
    with (folder / "launch.log").open("w") as file:
        log = LaunchLog(file)
        log.say("INFO", "launch", f"All log files can be found below {folder}")
        log.say("INFO", "launch", "Default logging verbosity is set to INFO")
        try:
            description.load(path)
        except CommandError as error:
            log.say("ERROR", "launch", f"Caught exception in launch (see debug for traceback): {error}")
            return 1
        signal_children = args.noninteractive or not sys.stdin or not sys.stdin.isatty()
        asyncio.run(LaunchService(description.processes, log, signal_children).run())
    return 0
