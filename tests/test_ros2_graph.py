"""`ros2` and what is in the graph, with real nodes in other processes: topics, nodes, parameters, actions."""

from __future__ import annotations

import os
import re
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from busy_cores import busy_cores
from ros2_graph_process import topic_names
from ros2_process import ROS2, TIMEOUT, Background, ros2, ros2_each
from ros_domain import next_domain

GRAPH = str(Path(__file__).with_name("ros2_graph_process.py"))
PROCESSES = 4
ALWAYS = {"/parameter_events", "/rosout"}


@contextmanager
def graph(*parts: str) -> Iterator[tuple[dict[str, str], list[Background]]]:
    """Start processes of nodes in a domain of their own; yield its environment, and them when all are ready."""
    environment = {**os.environ, "ROS_DOMAIN_ID": str(next_domain()), "PYTHONUNBUFFERED": "1"}
    started = [Background(environment, sys.executable, GRAPH, part) for part in parts]
    try:
        for one in started:
            one.read_until("ready")
        yield environment, started
    finally:
        for one in started:
            one.end(signal.SIGTERM)


@pytest.fixture(scope="module")
def publishing() -> Iterator[dict[str, str]]:
    with graph(*map(str, range(PROCESSES))) as (environment, _):
        yield environment


@pytest.fixture(scope="module")
def acting() -> Iterator[tuple[dict[str, str], Background]]:
    with graph("action") as (environment, (server,)):
        yield environment, server


def all_topics(processes: int) -> set[str]:
    """Return what `topic list` is to show."""
    talks = {f"/p{process}/{name}" for process in range(processes) for name in ("talk", "hear")}
    return topic_names(processes) | talks | ALWAYS


# --- topics and nodes


def test_topic_list_is_complete_at_the_first_look(publishing):
    with busy_cores():
        listed = ros2(publishing, "topic", "list")
    assert (listed.returncode, listed.stderr) == (0, "")
    assert set(listed.stdout.splitlines()) == all_topics(PROCESSES)
    assert listed.stdout.splitlines() == sorted(listed.stdout.splitlines())


@pytest.mark.soak
@pytest.mark.timeout(1200)
def test_topic_list_is_complete_in_20_of_20_tries_with_busy_cores(publishing):
    with busy_cores():
        tries = [set(ros2(publishing, "topic", "list").stdout.splitlines()) for _ in range(20)]
    assert [len(found) for found in tries] == [len(all_topics(PROCESSES))] * 20
    assert all(found == all_topics(PROCESSES) for found in tries)


def test_a_process_that_does_not_answer_is_told_of():
    with graph("0", "1") as (environment, processes):
        processes[1].process.send_signal(signal.SIGSTOP)
        try:
            listed = ros2(environment, "topic", "list")
        finally:
            processes[1].process.send_signal(signal.SIGCONT)
    assert set(listed.stdout.splitlines()) >= topic_names(1)
    assert not set(listed.stdout.splitlines()) & {"/p1/talk"}
    assert listed.stderr.startswith("WARNING: 1 participant(s) of this domain on this machine did not answer")
    assert len(listed.stderr.splitlines()) == 1


def test_topic_info(publishing):
    info, verbose, unknown = ros2_each(
        publishing,
        ["topic", "info", "/p1/talk"],
        ["topic", "info", "-v", "/p2/hear"],
        ["topic", "info", "/none"],
    )
    assert info.stdout == "Type: std_msgs/msg/String\nPublisher count: 1\nSubscription count: 0\n"
    assert "Publisher count: 0\n\nSubscription count: 1\n\nNode name: n0\nNode namespace: /p2\n" in verbose.stdout
    assert "Reliability: RELIABLE" in verbose.stdout
    assert (unknown.returncode, unknown.stdout, unknown.stderr) == (1, "", "Unknown topic '/none'\n")


def test_echo_hears_best_effort_publishers_also_when_they_come_later(publishing):
    echo = ros2(publishing, "topic", "echo", "--once", "/p0/talk")
    assert (echo.returncode, echo.stdout) == (0, "data: said\n---\n")
    environment = {**os.environ, "ROS_DOMAIN_ID": str(next_domain()), "PYTHONUNBUFFERED": "1"}
    early = Background(environment, ROS2, "topic", "echo", "--once", "/p0/talk", "std_msgs/msg/String")
    late = Background(environment, sys.executable, GRAPH, "0")
    try:
        assert early.process.wait(TIMEOUT) == 0
    finally:
        early.end()
        late.end(signal.SIGTERM)
    assert early.output == "data: said\n---\n"


def test_node_list(publishing):
    names = [f"/p{process}/n{number}" for process in range(PROCESSES) for number in range(2)]
    listed, count = ros2_each(publishing, ["node", "list"], ["node", "list", "-c"])
    assert listed.stdout.splitlines() == names
    assert count.stdout == f"{len(names)}\n"
    everything = ros2(publishing, "node", "list", "--all").stdout.splitlines()
    assert [name for name in everything if not name.startswith("/_ros2cli")] == names
    assert len(everything) == len(names) + 1


# --- parameters


def test_param_list(publishing):
    own = ["count", "label", "motor.speed", "names", "on", "start_type_description_service", "use_sim_time"]
    listed, typed, prefixed, everything = ros2_each(
        publishing,
        ["param", "list", "/p0/n0"],
        ["param", "list", "p0/n0", "--param-type", "--filter", "^(m|n)"],
        ["param", "list", "/p0/n0", "--param-prefixes", "motor"],
        ["param", "list"],
    )
    assert listed.stdout.splitlines() == [f"  {name}" for name in own]
    assert typed.stdout == "  motor.speed (type: double)\n  names (type: string array)\n"
    assert prefixed.stdout == "  motor.speed\n"
    assert [line for line in everything.stdout.splitlines() if not line.startswith(" ")] == [
        f"/p{process}/n{number}:" for process in range(PROCESSES) for number in range(2)
    ]


def test_param_get_and_set(publishing):
    lines = {
        "motor.speed": "Double value is: 0.5",
        "label": "String value is: fast",
        "count": "Integer value is: 3",
        "on": "Boolean value is: True",
        "names": "String values are: ['a', 'b']",
    }
    got = ros2_each(publishing, *(["param", "get", "/p1/n0", name] for name in lines))
    assert [one.stdout for one in got] == [line + "\n" for line in lines.values()]
    try:
        done = ros2(publishing, "param", "set", "/p1/n0", "count", "8")
        assert (done.returncode, done.stdout) == (0, "Set parameter successful\n")
        assert ros2(publishing, "param", "get", "/p1/n0", "count", "--hide-type").stdout == "8\n"
        refused = ros2(publishing, "param", "set", "/p1/n0", "count", "many")
        assert (refused.returncode, refused.stdout) == (0, "")
        assert refused.stderr.startswith("Setting parameter failed: ")
    finally:
        ros2(publishing, "param", "set", "/p1/n0", "count", "3")  # as another try expects it


def test_param_of_what_is_not_there(publishing):
    cases = [
        (["get", "/p1/n0", "nothing"], "Parameter not set"),
        (["get", "/p1/n9", "count"], "Node not found"),
        (["set", "/p1/n9", "count", "1"], "Node not found"),
        (["list", "/p1/n9"], "Node not found"),
        (["list", "--filter", "["], "'[' is no regular expression: unterminated character set at position 0"),
    ]
    for (_, message), wrong in zip(cases, ros2_each(publishing, *(["param", *arguments] for arguments, _ in cases))):
        assert (wrong.returncode, wrong.stdout, wrong.stderr) == (1, "", message + "\n")


# --- actions


def test_action_list_and_info(acting):
    environment, _ = acting
    listed, typed, count, info, info_count = ros2_each(
        environment,
        ["action", "list"],
        ["action", "list", "-t"],
        ["action", "list", "-c"],
        ["action", "info", "/pick_place", "-t"],
        ["action", "info", "/pick_place", "-c"],
    )
    assert listed.stdout == "/pick_place\n"
    assert typed.stdout == "/pick_place [cliport_interfaces/action/PickPlace]\n"
    assert count.stdout == "1\n"
    assert info.stdout == (
        "Action: /pick_place\nAction clients: 0\nAction servers: 1\n"
        "    /arm/server [cliport_interfaces/action/PickPlace]\n"
    )
    assert info_count.stdout.endswith("clients: 0\nAction servers: 1\n")


def test_action_send_goal(acting):
    environment, _ = acting
    send = ["action", "send_goal", "/pick_place", "cliport_interfaces/action/PickPlace"]
    done = ros2(environment, *send, "{instruction: go, pick: {position: {x: 0.5}}}", "--feedback")
    assert done.returncode == 0, done.stderr
    assert re.match(
        r"Waiting for an action server to become available\.\.\.\nSending goal:\n     header:\n", done.stdout
    )
    assert "instruction: go\n" in done.stdout
    assert re.search(r"\nGoal accepted with ID: [0-9a-f]{32}\n\n", done.stdout)
    assert re.findall(r"Feedback:\n    phase: 0\nphase_name: descend\nprogress: (\S+)\n", done.stdout) == [
        "0.25",
        "0.5",
    ]
    assert "\nResult:\n    outcome: 0\n" in done.stdout
    assert "\nmessage: done\n" in done.stdout
    assert done.stdout.endswith("\nGoal finished with status: SUCCEEDED\n")
    rejected = ros2(environment, *send, "{instruction: never}")
    assert (rejected.returncode, rejected.stdout.splitlines()[-1]) == (0, "Goal was rejected.")
    assert "Feedback" not in ros2(environment, *send).stdout


def test_action_send_goal_is_canceled_by_ctrl_c(acting):
    environment, server = acting
    send = Background(
        environment, ROS2, "action", "send_goal", "/pick_place", "cliport_interfaces/action/PickPlace",
        "{instruction: wait}",
    )  # fmt: skip
    server.read_until("waiting")
    send.read_until("Goal accepted")
    assert send.end(signal.SIGINT) == 2, send.output
    assert send.output.endswith("Canceling goal...\nGoal canceled.\n")
    server.read_until("canceled")


@pytest.mark.parametrize(
    ("kind", "goal", "message"),
    [
        ("cliport_interfaces/action/None", "{}", "The passed action type is invalid"),
        ("std_msgs/msg/String", "{}", "The passed action type is invalid"),
        ("cliport_interfaces/action/PickPlace", "words", "The passed value needs to be a dictionary in YAML format"),
        ("cliport_interfaces/action/PickPlace", "{where: 1}", "no attribute 'where'"),
    ],
)
def test_action_send_goal_refuses_in_one_line(acting, kind, goal, message):
    wrong = ros2(acting[0], "action", "send_goal", "/pick_place", kind, goal)
    assert wrong.returncode == 1
    assert message in wrong.stderr
    assert len(wrong.stderr.splitlines()) == 1
