"""`ros2 run demo_tool app`: the page on which a person demonstrates, in one process with its node."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable
from pathlib import Path

from cliport_episodes.errors import EpisodesError
from cliport_perception.errors import PerceptionError
from cliport_perception.ros_running import run_node
from demo_tool.errors import DemoToolError
from demo_tool.ros_link import RosLink
from demo_tool.station import Station
from demo_tool.web.access import AccessRule
from demo_tool.web.application import make_application
from demo_tool.web.server import WebServer, bind

_ROS_ARGUMENTS = "--ros-args"


class FolderError(DemoToolError):
    """A folder for data sets in which nothing can be kept."""


def main(argv: list[str] | None = None) -> int:
    """Entry point; returns the exit status. SIGINT and SIGTERM cancel what the arm does for this page."""
    argv = sys.argv[1:] if argv is None else argv
    own = argv[: argv.index(_ROS_ARGUMENTS)] if _ROS_ARGUMENTS in argv else argv
    options = _parser().parse_args(own)
    try:
        rule = AccessRule.for_address(options.host, options.token, options.name)
        root = _folder(options.data_sets)
        listener = bind(options.host, options.port)
    except DemoToolError as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    servers: list[WebServer] = []

    def make_node(fail: Callable[[BaseException], None]) -> RosLink:
        link = RosLink()
        station = Station(link.config, link.arm, link.policy, root)
        link.attach(station)
        servers.append(WebServer(make_application(station, rule), listener, fail))
        servers[0].start()
        print(_address(options.host, listener.getsockname()[1], rule), flush=True)
        return link

    def close(link: RosLink) -> None:
        link.close()
        servers[0].stop()

    return run_node(make_node, (DemoToolError, PerceptionError, EpisodesError, OSError), [sys.argv[0], *argv], close)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="ros2 run demo_tool app", description=__doc__)
    parser.add_argument("--host", default="127.0.0.1", help="address to listen on; other than loopback asks a token")
    parser.add_argument("--port", type=int, default=8080, help="0 takes a free one")
    parser.add_argument("--data-sets", type=Path, default=Path("demonstrations"), help="folder of the data sets")
    parser.add_argument("--token", help="what a browser must show once; made and printed where one is needed")
    parser.add_argument("--name", action="append", default=[], help="another name of this machine, as of a proxy")
    return parser


def _folder(path: Path) -> Path:
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise FolderError(
            f"cannot make the folder {path} ({error.strerror}); choose another with --data-sets"
        ) from error
    if not os.access(path, os.W_OK | os.X_OK):
        raise FolderError(f"nothing can be written to the folder {path}; choose another with --data-sets")
    return path.resolve()


def _address(host: str, port: int, rule: AccessRule) -> str:
    name = os.uname().nodename if host in {"0.0.0.0", "::", ""} else host
    name = f"[{name}]" if ":" in name else name
    query = f"?token={rule.token}" if rule.token else ""
    return f"Open http://{name}:{port}/{query} in a browser; Ctrl+C ends this."


if __name__ == "__main__":
    sys.exit(main())
