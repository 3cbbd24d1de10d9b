"""The command: how it starts, what it says, how soon it ends."""

import http.client
import os
import re
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from ros_domain import next_domain

for package in ("rclpy", "cliport_interfaces"):
    pytest.importorskip(package, exc_type=ImportError)

COMMAND = [sys.executable, "-c", "from demo_tool.app import main; raise SystemExit(main())"]
ENVIRONMENT = os.environ | {"ROS_DOMAIN_ID": str(next_domain())}


def start(*arguments: str) -> subprocess.Popen[str]:
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    return subprocess.Popen([*COMMAND, *arguments], env=ENVIRONMENT, **pipes)  # type: ignore[call-overload]


def status(port: int, path: str, host: str = "localhost") -> int:
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=5)
    connection.request("GET", path, headers={"Host": host})
    answer = connection.getresponse()
    answer.read()
    connection.close()
    return answer.status


@pytest.fixture
def taken_port() -> Iterator[int]:
    with socket.create_server(("127.0.0.1", 0)) as listener:
        yield listener.getsockname()[1]


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_it_serves_and_ends_within_two_seconds(tmp_path: Path, number: signal.Signals) -> None:
    process = start("--port", "0", "--data-sets", str(tmp_path / "new" / "sets"))
    assert process.stdout is not None
    found = re.search(r"http://127\.0\.0\.1:(\d+)/ ", process.stdout.readline())
    assert found is not None
    port = int(found[1])
    assert status(port, "/") == 200
    polling = socket.create_connection(("127.0.0.1", port))
    polling.sendall(b"GET /picture/color.jpg HTTP/1.1\r\nHost: localhost\r\n\r\n")  # a page that waits for a picture
    time.sleep(0.2)
    began = time.monotonic()
    process.send_signal(number)
    _, errors = process.communicate(timeout=15)
    assert time.monotonic() - began < 2.0
    assert process.returncode == 0 and errors == ""
    assert (tmp_path / "new" / "sets").is_dir()


def test_beyond_loopback_it_prints_the_address_with_its_token(tmp_path: Path) -> None:
    process = start("--host", "0.0.0.0", "--port", "0", "--data-sets", str(tmp_path))
    assert process.stdout is not None
    found = re.search(r"http://[^/]+:(\d+)(/\?token=[\w-]{16,}) ", process.stdout.readline())
    assert found is not None
    assert status(int(found[1]), "/") == 401 and status(int(found[1]), found[2]) == 303
    process.terminate()
    assert process.wait(timeout=15) == 0


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--port", "{port}"], "port {port}"),
        (["--port", "99999"], "99999"),
        (["--host", "no.such.host.invalid"], "no.such.host.invalid"),
        (["--data-sets", "{file}/sets"], "--data-sets"),
        (["--host", "0.0.0.0", "--token", "1234"], "16"),
        (["--port", "0", "--ros-args", "-p", "workspace:=/nowhere/workspace.yaml"], "/nowhere/workspace.yaml"),
    ],
)
def test_bad_settings_end_in_one_line(tmp_path: Path, taken_port: int, arguments: list[str], words: str) -> None:
    file = tmp_path / "a-file"
    file.touch()
    given = [argument.format(port=taken_port, file=file) for argument in arguments]
    process = start("--data-sets", str(tmp_path), *given)
    _, errors = process.communicate(timeout=30)
    assert process.returncode == 1
    assert len(errors.splitlines()) == 1 and errors.startswith("error: "), errors
    assert words.format(port=taken_port) in errors
