"""Program `ros2 run demo_tool app`: the demonstration page, in one process with its node."""

from __future__ import annotations

import argparse
import os
import sys
import threading
import webbrowser
from collections.abc import Callable
from pathlib import Path

from cliport_core.command_line import CommandParser
from cliport_core.errors import CoreError
from cliport_core.ros_running import run_node
from cliport_episodes.errors import EpisodesError
from demo_tool.calibration_process import CalibrationProcess
from demo_tool.errors import DemoToolError
from demo_tool.lesson_process import LessonProcess
from demo_tool.ports import Programs
from demo_tool.ros_link import RosLink
from demo_tool.station import Station
from demo_tool.web.access import AccessError, AccessRule, token_from
from demo_tool.web.application import make_application
from demo_tool.web.server import TlsFiles, WebServer, bind

_ROS_ARGUMENTS = "--ros-args"


class FolderError(DemoToolError):
    """A folder for data sets to which nothing can be written."""


def main(argv: list[str] | None = None) -> int:
    """Run the page and return the exit status; SIGINT and SIGTERM cancel the motion that the page started."""
    argv = sys.argv[1:] if argv is None else argv
    own = argv[: argv.index(_ROS_ARGUMENTS)] if _ROS_ARGUMENTS in argv else argv
    options = _parser().parse_args(own)
    try:
        rule = AccessRule.for_address(options.host, _token(options), options.name, options.ask_token)
        if options.open and rule.token:
            raise AccessError("--open would show the token to all users of this machine: open the page yourself")
        tls = _tls(options)
        root = _folder(options.data_sets)
        listener = bind(options.host, options.port)
    except DemoToolError as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    servers: list[WebServer] = []
    lessons = LessonProcess(options.learned or root.parent / "learned", options.old)

    def make_node(fail: Callable[[BaseException], None]) -> RosLink:
        link = RosLink()
        calibrations = CalibrationProcess(options.calibration, link.robot, argv[len(own) :])
        programs = Programs(lessons, calibrations)
        station = Station(link.config, link.arm, link.policy, root, scenes=link.scenes, programs=programs)
        link.attach(station)
        servers.append(WebServer(make_application(station, rule), listener, fail, tls))
        servers[0].start()
        address = _address(options.host, listener.getsockname()[1], rule, tls is not None)
        print(f"Open {address} in a browser; Ctrl+C ends this.", flush=True)
        if options.open:
            threading.Thread(target=webbrowser.open, args=(address,), daemon=True).start()
        return link

    def close(link: RosLink) -> None:
        link.close()
        servers[0].stop()

    return run_node(make_node, (DemoToolError, CoreError, EpisodesError, OSError), [sys.argv[0], *argv], close)


def _parser() -> argparse.ArgumentParser:
    parser = CommandParser(prog="ros2 run demo_tool app", description=__doc__, allow_abbrev=False)
    parser.add_argument("--host", default="127.0.0.1", help="address to listen on; other than loopback asks a token")
    parser.add_argument("--port", type=int, default=8080, help="0 takes a free one")
    parser.add_argument("--data-sets", type=Path, default=Path("demonstrations"), help="folder of the data sets")
    parser.add_argument("--learned", type=Path, help="folder for policies that learn (default: learned, beside)")
    parser.add_argument("--old", type=Path, help="training set of what the policies know, not to be forgotten")
    parser.add_argument("--calibration", type=Path, default=Path("calibration/camera.yaml"), help="written by Camera")
    parser.add_argument("--token", help=argparse.SUPPRESS)
    parser.add_argument("--token-file", type=Path, help="holds what a browser must show once; made where there is none")
    parser.add_argument("--ask-token", action="store_true", help="ask a token on loopback too: others use this machine")
    parser.add_argument("--tls-cert", type=Path, help="certificate (PEM), to be reached by https")
    parser.add_argument("--tls-key", type=Path, help="its private key (PEM)")
    parser.add_argument("--open", action="store_true", help="show the page in this machine's browser, if it has one")
    parser.add_argument("--name", action="append", default=[], help="another name of this machine, as of a proxy")
    return parser


def _token(options: argparse.Namespace) -> str | None:
    if options.token is not None:
        raise AccessError(
            "a token on the command line can be read by all users of this machine: write it to a file and name that "
            "with --token-file"
        )
    return None if options.token_file is None else token_from(options.token_file)


def _tls(options: argparse.Namespace) -> TlsFiles | None:
    if options.tls_cert is None and options.tls_key is None:
        return None
    if options.tls_cert is None or options.tls_key is None:
        raise AccessError("--tls-cert and --tls-key belong together: give both, or neither")
    files = TlsFiles(options.tls_cert, options.tls_key)
    files.check()
    return files


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


def _address(host: str, port: int, rule: AccessRule, tls: bool) -> str:
    name = os.uname().nodename if host in {"0.0.0.0", "::", ""} else host
    name = f"[{name}]" if ":" in name else name
    query = f"?token={rule.token}" if rule.token else ""
    return f"{'https' if tls else 'http'}://{name}:{port}/{query}"


if __name__ == "__main__":
    sys.exit(main())
