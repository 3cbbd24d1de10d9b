"""The command: how it starts, what it says, how soon it ends."""

import contextlib
import http.client
import os
import re
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest
from ros_domain import next_domain
from station_fakes import FakeArm, FakePolicy

from cliport_core.pose import PlanarPose

pytest.importorskip("rclpy", exc_type=ImportError)
pytest.importorskip("cliport_interfaces", exc_type=ImportError)

from demo_tool import app
from demo_tool.station import Station
from demo_tool.station_config import StationConfig
from demo_tool.web.access import AccessRule
from demo_tool.web.application import make_application
from demo_tool.web.server import WebServer, bind

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


def ask_for_ever(port: int) -> None:
    """A page that asks for a picture, and again when none came, until the server is gone."""
    with contextlib.suppress(OSError, http.client.HTTPException):
        while True:
            status(port, "/picture/color.jpg")


@pytest.fixture
def taken_port() -> Iterator[int]:
    with socket.create_server(("127.0.0.1", 0)) as listener:
        yield listener.getsockname()[1]


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_it_serves_and_ends_though_a_page_keeps_asking(tmp_path: Path, number: signal.Signals) -> None:
    process = start("--port", "0", "--data-sets", str(tmp_path / "new" / "sets"))
    assert process.stdout is not None
    found = re.search(r"http://127\.0\.0\.1:(\d+)/ ", process.stdout.readline())
    assert found is not None
    port = int(found[1])
    assert status(port, "/") == 200
    page = threading.Thread(target=ask_for_ever, args=(port,), daemon=True)
    page.start()
    assert status(port, "/") == 200
    process.send_signal(number)
    _, errors = process.communicate(timeout=60)
    assert process.returncode == 0 and errors == ""
    page.join(timeout=60)
    assert not page.is_alive()
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
    ("host", "tls", "address"),
    [
        ("127.0.0.1", False, "http://127.0.0.1:8080/"),
        ("127.0.0.1", True, "https://127.0.0.1:8080/"),
        ("::1", True, "https://[::1]:8080/"),
        ("0.0.0.0", False, f"http://{os.uname().nodename}:8080/?token=0123456789abcdef"),
    ],
)
def test_the_address_that_is_printed_can_be_opened(host: str, tls: bool, address: str) -> None:
    rule = AccessRule.for_address(host, "0123456789abcdef" if "token" in address else None)
    assert app._address(host, 8080, rule, tls) == address


def test_the_token_is_not_shown_on_a_browsers_command_line(capsys: pytest.CaptureFixture[str]) -> None:
    assert app.main(["--open", "--ask-token", "--port", "0"]) == 1
    assert capsys.readouterr().err.startswith("error: --open would show the token to all users of this machine")


def test_the_options_defaults() -> None:
    assert vars(app._parser().parse_args([])) == {
        "host": "127.0.0.1",
        "port": 8080,
        "data_sets": Path("demonstrations"),
        "learned": None,
        "old": None,
        "calibration": Path("calibration/camera.yaml"),
        "token": None,
        "token_file": None,
        "ask_token": False,
        "tls_cert": None,
        "tls_key": None,
        "open": False,
        "name": [],
    }
    assert app._parser().parse_args(["--ask-token", "--name", "a", "--name", "b"]).name == ["a", "b"]


def test_only_a_folder_that_can_be_written_to_is_taken(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert app._folder(tmp_path / "a" / "b") == tmp_path / "a" / "b" and (tmp_path / "a" / "b").is_dir()
    asked: list[int] = []
    monkeypatch.setattr(os, "access", lambda path, mode: asked.append(mode))
    with pytest.raises(app.FolderError, match="nothing can be written"):
        app._folder(tmp_path)
    assert asked == [os.W_OK + os.X_OK]


def test_the_servers_thread_has_ended_when_it_is_stopped(tmp_path: Path) -> None:
    def fail(error: BaseException) -> None:
        raise error

    rule = AccessRule.for_address("127.0.0.1", None)
    station = Station(StationConfig(), FakeArm(), FakePolicy(PlanarPose(0, 0, 0), PlanarPose(0, 0, 0)), tmp_path)
    listener = bind("127.0.0.1", 0)
    server = WebServer(make_application(station, rule), listener, fail)
    server.start()
    assert status(listener.getsockname()[1], "/") == 200
    thread = next(each for each in threading.enumerate() if each.name == "web")
    server.stop()
    thread.join(30.0)
    assert not thread.is_alive() and listener.fileno() == -1


def test_a_token_from_a_file_is_asked_for_on_loopback_too_and_is_in_no_list_of_processes(tmp_path: Path) -> None:
    path = tmp_path / "token"
    for options in (["--token-file", str(path)], ["--ask-token"]):
        process = start("--port", "0", "--data-sets", str(tmp_path), *options)
        assert process.stdout is not None
        found = re.search(r"http://127\.0\.0\.1:(\d+)/\?token=([\w-]{16,}) ", process.stdout.readline())
        assert found is not None
        assert status(int(found[1]), "/") == 401 and status(int(found[1]), f"/?token={found[2]}") == 303
        for shown in ("cmdline", "environ"):
            assert found[2].encode() not in Path(f"/proc/{process.pid}/{shown}").read_bytes()
        process.terminate()
        assert process.wait(timeout=15) == 0
        assert "--ask-token" in options or path.read_text().strip() == found[2]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--port", "{port}"], "port {port}"),
        (["--port", "99999"], "99999"),
        (["--host", "no.such.host.invalid"], "no.such.host.invalid"),
        (["--data-sets", "{file}/sets"], "--data-sets"),
        (["--host", "0.0.0.0", "--token", "a-token-that-all-can-see"], "--token-file"),
        (["--token-file", "{file}"], "chmod 600"),
        (["--tls-cert", "{file}"], "--tls-cert and --tls-key belong together"),
        (["--tls-key", "{file}"], "--tls-cert and --tls-key belong together"),
        (["--tls-cert", "{file}", "--tls-key", "{file}"], "PEM"),
    ],
)
def test_bad_settings_end_in_one_line(
    tmp_path: Path, taken_port: int, arguments: list[str], words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "a-file"
    file.touch()
    given = [argument.format(port=taken_port, file=file) for argument in arguments]
    assert app.main(["--data-sets", str(tmp_path), *given]) == 1
    said, errors = capsys.readouterr()
    assert not said
    assert len(errors.splitlines()) == 1 and errors.startswith("error: "), errors
    assert words.format(port=taken_port) in errors


def test_a_bad_parameter_ends_in_one_line(tmp_path: Path) -> None:
    process = start("--data-sets", str(tmp_path), "--port", "0", "--ros-args", "-p", "workspace:=/nowhere/file.yaml")
    _, errors = process.communicate(timeout=30)
    assert process.returncode == 1
    assert len(errors.splitlines()) == 1 and errors.startswith("error: ") and "/nowhere/file.yaml" in errors, errors
