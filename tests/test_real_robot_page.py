"""The commands of docs/real-robot.md: each is marked, means something, and is run where it says so."""

from __future__ import annotations

import re
import shlex
import signal
import subprocess
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import yaml
from hardware_times import ROOT
from ros2_process import ROS2
from ros2cli_small.graph import load_type
from ros2cli_small.launch_file import LaunchDescription
from ros2cli_small.message_values import fill_message, parse_values
from ros_domain import next_domain

from cliport_core import topics
from panda_driver.conformance.main import _parser as conformance_parser
from panda_driver.node_parameters import read_parameters
from panda_driver.node_record_run import _parser as record_parser
from panda_model import load_preset

PAGE = ROOT / "docs/real-robot.md"
LINE = re.compile(r"^    (\S.*?)\s+# (sim|not run)(?:: .*)?$")
FR3 = load_preset("fr3")
OTHERS = {"franka_fr3_moveit_config"}  # packages of the arm's maker
LASTING = ("panda_driver driver", "panda_driver record_run", "cliport_bringup real.launch.yaml")  # until Ctrl-C
TIMEOUT = 300.0  # of one command, against an arm that may be ten times slower than real time [s]


def page_commands() -> list[tuple[str, str]]:
    """Return (command, mark) of each line that is one, in the page's order."""
    lines = [line for line in PAGE.read_text().splitlines() if line.startswith("    ")]
    found = [LINE.match(line) for line in lines]
    assert all(found), [line for line, match in zip(lines, found) if match is None]
    return [(match[1], match[2]) for match in found if match is not None]


def test_every_command_says_whether_it_ran() -> None:
    marks = [mark for _, mark in page_commands()]
    assert marks.count("sim") >= 10 and marks.count("not run") >= 5


@pytest.mark.parametrize("command", [command for command, _ in page_commands() if command.startswith("ros2 ")])
def test_a_command_means_something(command: str, monkeypatch: pytest.MonkeyPatch) -> None:
    words = shlex.split(command)[1:]
    check = {"run": _check_run, "launch": _check_launch, "service": _check_service, "action": _check_action}
    check.get(words[0], _check_topic)(words[1:])


def _check_run(words: list[str]) -> None:
    package, executable, *given = words
    assert f'"{executable} = ' in (ROOT / "src" / package / "setup.py").read_text()
    own = given[: given.index("--ros-args")] if "--ros-args" in given else given
    parsers = {"conformance": conformance_parser, "record_run": record_parser}
    if executable in parsers:
        parsers[executable]().parse_args(own)
    parameters = [word.partition(":=") for word in given if ":=" in word]
    if executable == "driver":
        _check_driver_parameters({name: yaml.safe_load(value) for name, _, value in parameters})


def _check_driver_parameters(given: dict[str, Any]) -> None:
    """Read them as the driver does; one that nobody reads is unknown."""
    read: set[str] = set()

    def declare(name: str, default: Any) -> SimpleNamespace:
        read.add(name)
        return SimpleNamespace(value=given.get(name, default))

    read_parameters(SimpleNamespace(declare_parameter=declare))  # type: ignore[arg-type]
    assert set(given) <= read | {"use_sim_time"}


def _check_launch(words: list[str]) -> None:
    package, file, *arguments = words
    if package in OTHERS:
        return
    given = dict(word.split(":=", 1) for word in arguments)
    launch = LaunchDescription(given)
    launch.load(ROOT / "src" / package / "launch" / file)
    assert launch.processes


def _check_service(words: list[str]) -> None:
    verb, name, kind, *values = words
    executor = {value for key, value in vars(topics).items() if key.isupper() and isinstance(value, str)}
    driver = {"/panda_driver/recover_errors", "/panda_driver/home_gripper", FR3.gripper_stop}
    assert verb == "call" and name in executor | driver, name
    fill_message(load_type(kind, "service").Request(), parse_values(*values) if values else {})


def _check_action(words: list[str]) -> None:
    verb, name, kind, values = words
    assert verb == "send_goal" and name in FR3.motion_actions, name
    fill_message(load_type(kind, "action").Goal(), parse_values(values))


def _check_topic(words: list[str]) -> None:
    verb, _, name, kind, values = words
    assert verb == "pub" and name == topics.INSTRUCTION
    fill_message(load_type(kind, "message")(), parse_values(values))


@pytest.fixture
def lasting(tmp_path: Path) -> Iterator[dict[str, subprocess.Popen[str]]]:
    running: dict[str, subprocess.Popen[str]] = {}
    yield running
    for process in reversed(running.values()):
        process.send_signal(signal.SIGINT)
        process.wait(60.0)


def for_the_simulator(command: str, address: str) -> list[str]:
    """Return the words of a command for an arm that is simulated, slower than real time, and has no camera."""
    words = [word.replace("172.16.0.2", address).replace("127.0.0.1", address) for word in shlex.split(command)]
    words[0] = ROS2
    if "real.launch.yaml" in command:
        return [*words, "realtime:=false", "publish_clock:=true"]
    added = ["use_sim_time:=true", *(["realtime:=false", "publish_clock:=true"] if " driver " in command else [])]
    if words[1] != "run":
        return words
    given = [part for pair in added for part in ("-p", pair)]
    return [*words, *([] if "--ros-args" in words else ["--ros-args"]), *given]


@pytest.mark.soak
def test_the_commands_that_say_so_run(
    tmp_path: Path, lasting: dict[str, subprocess.Popen[str]], monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("franky", reason="needs franky: make setup EXTRAS='all driver'")
    pytest.importorskip("franky_sim", reason="needs franky-sim: make setup EXTRAS='all driver'")
    from franky_bench import Processes, TableArm

    domain = next_domain()
    monkeypatch.setenv("ROS_DOMAIN_ID", str(domain))
    monkeypatch.chdir(tmp_path)
    processes = Processes(tmp_path, domain)
    arm = TableArm(processes)
    for number, (command, mark) in enumerate(page_commands()):
        if mark == "sim":
            _run(command, for_the_simulator(command, arm.address), tmp_path / f"{number}.log", lasting)
    processes.close()


def _run(command: str, words: list[str], log: Path, lasting: dict[str, subprocess.Popen[str]]) -> None:
    """Run a command to its end, or until it drives the arm where it lasts; another driver of before is ended."""
    kind = next((name for name in LASTING if name in command), "")
    if not kind:
        done = subprocess.run(words, capture_output=True, text=True, timeout=TIMEOUT, stdin=subprocess.DEVNULL)
        log.write_text(done.stdout + done.stderr)
        assert done.returncode == 0, f"{command}\n{done.stdout[-3000:]}{done.stderr[-3000:]}"
        return
    drives = "record_run" not in kind
    for name in [name for name in lasting if drives and "record_run" not in name]:
        process = lasting.pop(name)
        process.send_signal(signal.SIGINT)
        assert process.wait(60.0) == 0, name
    with log.open("w") as out:
        lasting[f"{kind} {log.stem}"] = subprocess.Popen(words, stdout=out, stderr=out, text=True)
    _wait_for(drives, log, lasting[f"{kind} {log.stem}"])


def _wait_for(drives: bool, log: Path, process: subprocess.Popen[str]) -> None:
    """Wait until a driver drives the arm, or a record is begun."""
    while not ("driving the fr3" in log.read_text() if drives else list(log.parent.glob("runs/*/motions.jsonl"))):
        try:
            process.wait(0.2)
        except subprocess.TimeoutExpired:
            continue
        raise AssertionError(log.read_text()[-3000:])
