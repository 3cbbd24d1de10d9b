"""The `ros2` command, with real processes over real DDS: what it prints, how it ends, what it leaves."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import suppress

import pytest
from ros2_process import ROS2, TIMEOUT, Background, ros2
from ros_domain import next_domain

SERVER = """
import rclpy
from std_srvs.srv import SetBool
rclpy.init()
node = rclpy.create_node("switch")
def answer(request, response):
    response.success, response.message = request.data, "on" if request.data else "off"
    return response
node.create_service(SetBool, "/switch", answer)
print("ready", flush=True)
rclpy.spin(node)
"""

STUBBORN = """#!/usr/bin/env python3
import signal, sys, time
signal.signal(signal.SIGINT, signal.SIG_IGN)
print("deaf to SIGINT", flush=True)
while True:
    time.sleep(0.1)
"""

LAUNCH = """
launch:
  - arg: {name: word, default: hello, description: what is said}
  - arg: {name: extra, default: "false"}
  - let: {name: both, value: "$(var word)-$(env CLI_TEST_WORD nobody)"}
  - node:
      pkg: cli_test
      exec: say
      name: speaker
      namespace: /group
      output: screen
      args: "'$(var both)' $(find-pkg-share cli_test)"
      remap: [{from: a, to: b}]
      env: [{name: SPOKEN_BY, value: launch}]
      param: [{name: number, value: "$(env CLI_TEST_NUMBER 7)"}, {name: text, value: "7", type: str}]
  - node: {pkg: cli_test, exec: fail, output: screen, if: $(var extra)}
"""


@pytest.fixture(scope="module")
def environment(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """An environment with a package of scripts, its own log folder, and a domain that nobody else uses."""
    prefix = tmp_path_factory.mktemp("prefix")
    index = prefix / "share/ament_index/resource_index/packages"
    for folder in (index, prefix / "lib/cli_test", prefix / "share/cli_test/launch"):
        folder.mkdir(parents=True)
    (index / "cli_test").touch()
    scripts = {
        "say": '#!/bin/bash\necho "args: $*"\necho "by: $SPOKEN_BY"\n'
        'while [ $# -gt 0 ]; do [ "$1" = --params-file ] && cat "$2"; shift; done\n',
        "fail": "#!/bin/bash\necho failing >&2\nexit 3\n",
        "wait": "#!/bin/bash\necho waiting\nexec sleep 600\n",
        "stubborn": STUBBORN,
    }
    for name, text in scripts.items():
        script = prefix / "lib/cli_test" / name
        script.write_text(text)
        script.chmod(0o755)
    share = prefix / "share/cli_test/launch"
    (share / "say.launch.yaml").write_text(LAUNCH)
    (share / "outer.launch.yaml").write_text(
        "launch:\n  - include:\n      file: $(dirname)/say.launch.yaml\n      arg: [{name: word, value: outer}]\n"
    )
    (share / "stay.launch.yaml").write_text(
        "launch:\n  - node: {pkg: cli_test, exec: wait, output: screen}\n"
        "  - node: {pkg: cli_test, exec: stubborn, output: screen, sigterm_timeout: '0.5'}\n"
    )
    (share / "typo.launch.yaml").write_text("launch:\n  - node: {pkg: cli_test, exec: say, outptu: screen}\n")
    (share / "needs.launch.yaml").write_text("launch:\n  - arg: {name: thing}\n")
    return {
        **os.environ,
        "AMENT_PREFIX_PATH": f"{prefix}{os.pathsep}{os.environ.get('AMENT_PREFIX_PATH', '')}",
        "ROS_DOMAIN_ID": str(next_domain()),
        "ROS_LOG_DIR": str(prefix / "log"),
        "PYTHONUNBUFFERED": "1",
    }


@pytest.fixture
def background(environment: dict[str, str]) -> Iterator:
    """Start `ros2` or other commands; what still runs at the end is ended."""
    started: list[Background] = []

    def start(*command: str) -> Background:
        started.append(Background(environment, *command))
        return started[-1]

    yield start
    for one in started:
        if one.process.poll() is None:
            with suppress(subprocess.TimeoutExpired):  # `end` has killed it: what ends well is tested by its own tests
                one.end(signal.SIGTERM)
        if one.process.stdout:
            one.process.stdout.close()


def is_alive(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    return True


# --- topics


def test_pub_once_reaches_echo_once(environment, background):
    echo = background(ROS2, "topic", "echo", "--once", "/words", "std_msgs/msg/String")
    pub = ros2(environment, "topic", "pub", "--once", "/words", "std_msgs/msg/String", "{data: 'hé \"quoted\"'}")
    assert pub.returncode == 0, pub.stderr
    assert "publisher: beginning loop" in pub.stdout
    assert "publishing #1: std_msgs.msg.String(data='hé \"quoted\"')" in pub.stdout
    assert echo.process.wait(TIMEOUT) == 0
    assert echo.end() == 0
    assert echo.output == 'data: hé "quoted"\n---\n'


def test_list_echo_and_hz_of_a_running_topic(environment, background):
    pub = background(
        ROS2, "topic", "pub", "-r", "20", "/poses", "geometry_msgs/msg/PoseStamped",
        "{header: {frame_id: base}, pose: {position: {x: 1, z: 0.5}}}",
    )  # fmt: skip
    pub.read_until("publishing #1:")
    hz = background(ROS2, "topic", "hz", "/poses", "-w", "20")

    listed = ros2(environment, "topic", "list", "-t")
    assert listed.returncode == 0
    assert "/poses [geometry_msgs/msg/PoseStamped]" in listed.stdout.splitlines()
    assert {"/parameter_events", "/rosout"} <= {line.split()[0] for line in listed.stdout.splitlines()}

    echo = ros2(environment, "topic", "echo", "--once", "/poses")
    assert echo.returncode == 0, echo.stderr
    assert echo.stdout.startswith(
        "header:\n  stamp:\n    sec: 0\n    nanosec: 0\n  frame_id: base\npose:\n  position:\n    x: 1.0\n"
    )
    field = ros2(environment, "topic", "echo", "--once", "--field", "pose.position", "--csv", "/poses")
    assert field.stdout == "1.0,0.0,0.5\n"
    wrong = ros2(environment, "topic", "echo", "--once", "--field", "pose.nothing", "/poses")
    assert wrong.returncode == 1
    assert "Traceback" not in wrong.stderr

    assert re.fullmatch(r"average rate: \d+\.\d{3}\n", hz.read_until("average rate"))
    hz.read_until(r"min: \d+\.\d{3}s max: \d+\.\d{3}s std dev: \d+\.\d{5}s window: \d+")
    assert hz.end(signal.SIGINT) == 2
    assert pub.end(signal.SIGINT) == 2
    assert "Traceback" not in hz.output + pub.output


def test_echo_gets_latched_messages_of_a_publisher_that_came_first(environment, background):
    pub = background(
        ROS2, "topic", "pub", "-r", "0.01", "--qos-durability", "transient_local",
        "/latched", "std_msgs/msg/Int32MultiArray", "{data: [1, 2, 3]}",
    )  # fmt: skip
    pub.read_until("publishing #1:")
    echo = ros2(environment, "topic", "echo", "--once", "--field", "data", "/latched")
    assert echo.stdout == "- 1\n- 2\n- 3\n---\n"


def test_echo_of_a_topic_that_nobody_publishes(environment):
    echo = ros2(environment, "topic", "echo", "--once", "/nothing")
    assert echo.returncode == 1
    assert "WARNING: topic [/nothing] does not appear to be published yet" in echo.stdout
    assert echo.stderr.strip() == "Could not determine the type for the passed topic"


@pytest.mark.parametrize(
    ("kind", "values", "message"),
    [
        ("nope/msg/String", "{}", "The passed message type is invalid"),
        ("std_msgs/msg/String", "just text", "The passed value needs to be a dictionary in YAML format"),
        (
            "std_msgs/msg/String",
            "{dat: x}",
            "Failed to populate field: 'String' object has no attribute 'dat'",
        ),
        ("std_msgs/msg/Int32", "{data: many}", "Failed to populate field"),
    ],
)
def test_pub_refuses_what_is_no_message(ros2_here, environment, kind, values, message):
    pub = ros2_here("topic", "pub", "-1", "/words", kind, values, environment=environment)
    assert pub.returncode == 1
    assert message in pub.stderr
    assert "Traceback" not in pub.stderr


# --- services


def test_service_call(ros2_here, environment, background):
    server = background(sys.executable, "-c", SERVER)
    server.read_until("ready")
    call = ros2(environment, "service", "call", "/switch", "std_srvs/srv/SetBool", "{data: true}")
    assert call.returncode == 0, call.stderr
    assert "requester: making request: std_srvs.srv.SetBool_Request(data=True)" in call.stdout
    assert "response:\nstd_srvs.srv.SetBool_Response(success=True, message='on')" in call.stdout
    wrong = ros2_here("service", "call", "/switch", "std_srvs/srv/Nope", environment=environment)
    assert (wrong.returncode, wrong.stderr.strip()) == (1, "The passed service type is invalid")


def test_service_call_waits_for_its_service(background):
    call = background(ROS2, "service", "call", "/absent", "std_srvs/srv/Trigger")
    call.read_until("waiting for service to become available...")
    assert call.end(signal.SIGINT) == 2


# --- run


def test_run_passes_arguments_and_exit_status(environment):
    said = ros2(environment, "run", "cli_test", "say", "--ros-args", "-p", "a:=b")
    assert (said.returncode, said.stdout.splitlines()[0]) == (0, "args: --ros-args -p a:=b")
    failed = ros2(environment, "run", "cli_test", "fail")
    assert failed.returncode == 3
    assert failed.stdout.strip().endswith("Process exited with failure 3")


def test_run_of_what_is_not_there(ros2_here, environment):
    package = ros2_here("run", "no_such_package", "say", environment=environment)
    assert (package.returncode, package.stderr.strip()) == (1, "Package 'no_such_package' not found")
    executable = ros2_here("run", "cli_test", "no_such_executable", environment=environment)
    assert (executable.returncode, executable.stderr.strip()) == (1, "No executable found")
    assert ros2_here("run", "cli_test", environment=environment).returncode == 2


def test_run_forwards_signals(background):
    waiting = background(ROS2, "run", "cli_test", "wait")
    waiting.read_until("waiting")
    assert waiting.end(signal.SIGTERM) == 256 - signal.SIGTERM  # the script sleeps longer than this waits
    assert "[ros2run]: SIGTERM" in waiting.output


# --- launch


def test_launch_substitutes_and_reports(environment):
    run = ros2(
        {**environment, "CLI_TEST_WORD": "you"},
        "launch",
        "cli_test",
        "say.launch.yaml",
        "word:=good day",
        "extra:=true",
    )
    assert run.returncode == 0, run.stderr
    output = run.stdout + run.stderr
    assert re.search(r"\[INFO\] \[say-1\]: process started with pid \[\d+\]", output)
    assert re.search(r"\[say-1\] args: good day-you \S+/share/cli_test --ros-args", output)
    assert "-r __node:=speaker -r __ns:=/group -r a:=b" in output
    assert "[say-1] by: launch" in output
    assert re.search(r"\[say-1\] +number: 7\n", output)
    assert re.search(r"\[say-1\] +text: '7'\n", output)
    assert re.search(r"\[INFO\] \[say-1\]: process has finished cleanly \[pid \d+\]", output)
    assert "[fail-2] failing" in output
    assert re.search(r"\[ERROR\] \[fail-2\]: process has died \[pid \d+, exit code 3, cmd '.*fail.*'\]\.", output)


def test_launch_includes_and_shows_arguments(ros2_here, environment):
    included = ros2(environment, "launch", "cli_test", "outer.launch.yaml")
    assert "args: outer-nobody" in included.stdout
    shown = ros2_here("launch", "cli_test", "say.launch.yaml", "--show-args", environment=environment)
    assert shown.returncode == 0
    assert "'word':\n        what is said\n        (default: 'hello')" in shown.stdout


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_launch_ends_its_processes(background, number):
    launch = background(ROS2, "launch", "cli_test", "stay.launch.yaml")
    launch.read_until("deaf to SIGINT")
    if "waiting" not in launch.output:
        launch.read_until("waiting")
    pids = [int(pid) for pid in re.findall(r"process started with pid \[(\d+)\]", launch.output)]
    assert len(pids) == 2
    assert launch.end(number) in (0, 1)
    assert "escalating to 'SIGTERM'" in launch.output
    assert not any(is_alive(pid) for pid in pids)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["no_such_package", "x.launch.yaml"], "Package 'no_such_package' not found"),
        (
            ["cli_test", "x.launch.yaml"],
            "file 'x.launch.yaml' was not found in the share directory of package 'cli_test'",
        ),
        (
            ["cli_test", "say.launch.yaml", "word"],
            "malformed launch argument 'word', expected format '<name>:=<value>'",
        ),
        (["cli_test", "typo.launch.yaml"], "outptu"),
        (["cli_test", "needs.launch.yaml"], "thing"),
    ],
)
def test_launch_refuses_in_one_line(ros2_here, environment, arguments, message):
    run = ros2_here("launch", *arguments, environment=environment)
    assert run.returncode == 1
    assert message in run.stdout + run.stderr
    assert "Traceback" not in run.stdout + run.stderr


@pytest.mark.parametrize("name", ["sim.launch.yaml", "policy.launch.yaml", "real.launch.yaml", "teach.launch.yaml"])
def test_shipped_launch_files_are_understood(ros2_here, environment, name):
    shown = ros2_here("launch", "cliport_bringup", name, "--show-args", environment=environment)
    assert shown.returncode == 0, shown.stderr
    assert "'checkpoint':" in shown.stdout
