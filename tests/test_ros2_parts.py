"""Parts of the `ros2` command that need no graph, with times handed in."""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import threading
from pathlib import Path

import pytest
from rclpy.qos import (
    DurabilityPolicy,
    HistoryPolicy,
    LivelinessPolicy,
    QoSPresetProfiles,
    ReliabilityPolicy,
)
from ros2cli_small import qos
from ros2cli_small.bag.playback_clock import PlaybackClock
from ros2cli_small.bag.player import ClockTicks
from ros2cli_small.bag.qos import profile_from_offers
from ros2cli_small.discovery import PATIENCE, QUIET_TIME, Completion, GraphState, count_participants
from ros2cli_small.errors import CommandError
from ros2cli_small.interface_show import definition, find_definition
from ros2cli_small.launch_file import LaunchDescription, ProcessPlan
from ros2cli_small.topic_hz import RateMeter
from rosbags.interfaces import Qos, QosDurability, QosHistory, QosLiveliness, QosReliability, QosTime

SECOND = 10**9
BRINGUP = Path(__file__).resolve().parent.parent / "src/cliport_bringup"


class FakeTime:
    """A steady time that only goes on where somebody waits."""

    def __init__(self) -> None:
        self.now = 5 * SECOND
        self.waits: list[float | None] = []

    def steady(self) -> int:
        return self.now

    def wait(self, _condition: threading.Condition, seconds: float | None) -> None:
        self.waits.append(seconds)
        assert seconds is not None, "nobody would wake it"
        self.now += round(seconds * SECOND)


# --- running

DEAF = """
import os, signal, sys, threading
from ros2cli_small.run import run_forwarding_signals
threading.Timer(0.5, os.kill, (os.getpid(), signal.SIGTERM)).start()
signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGTERM})
child = "import signal, time; signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGTERM}); time.sleep(60)"
sys.exit(run_forwarding_signals([sys.executable, "-c", child]) == -signal.SIGTERM)
"""


def test_a_signal_that_does_not_wake_run_is_forwarded_all_the_same():
    """As one that comes just before it waits: here another thread takes it."""
    paths = os.pathsep.join(path for path in sys.path if path)
    ended = subprocess.run([sys.executable, "-c", DEAF], env=os.environ | {"PYTHONPATH": paths}, timeout=20)
    assert ended.returncode == 1


# --- playing


@pytest.mark.parametrize(("rate", "seconds"), [(1.0, 3.0), (2.0, 1.5), (0.5, 6.0)])
def test_the_rate_divides_the_wait(rate, seconds):
    time = FakeTime()
    clock = PlaybackClock(rate, steady=time.steady, wait=time.wait)
    clock.jump(100 * SECOND)
    for stamp in (101, 102, 103):
        assert clock.wait_until(stamp * SECOND)
    assert time.now - 5 * SECOND == seconds * SECOND
    assert time.waits == [seconds / 3] * 3


def test_a_paused_clock_waits_to_be_woken():
    time = FakeTime()
    clock = PlaybackClock(1.0, paused=True, steady=time.steady, wait=time.wait)
    with pytest.raises(AssertionError, match="nobody would wake it"):
        clock.wait_until(SECOND)
    assert not clock.wait_until(SECOND, at_most=0.25)
    assert clock.now() == 0
    clock.set_paused(False)
    assert not clock.wait_until(SECOND, at_most=0.25)
    assert clock.now() == SECOND // 4
    assert clock.wait_until(SECOND)


def test_the_clock_topic_ticks_at_its_rate_whatever_the_playback():
    time = FakeTime()
    clock = PlaybackClock(0.5, steady=time.steady, wait=time.wait)
    published: list[int] = []
    ticks = ClockTicks(published.append, clock, 100.0, lambda: time.now / SECOND)
    while time.now < 6 * SECOND - 1000:
        time.now += round(ticks.publish_when_due() * SECOND)
    assert len(published) == 100
    assert published == pytest.approx([5_000_000 * tick for tick in range(100)], abs=100)


def offer(**values: object) -> Qos:
    zero = QosTime(0, 0)
    standard: dict[str, object] = {
        "history": QosHistory.KEEP_LAST, "depth": 1, "reliability": QosReliability.RELIABLE,
        "durability": QosDurability.VOLATILE, "deadline": zero, "lifespan": zero,
        "liveliness": QosLiveliness.AUTOMATIC, "liveliness_lease_duration": zero,
        "avoid_ros_namespace_conventions": False,
    }  # fmt: skip
    return Qos(**{**standard, **values})  # type: ignore[arg-type]


def test_mixed_recorded_qos_is_played_as_the_default(capsys):
    latched = offer(durability=QosDurability.TRANSIENT_LOCAL)
    sensor = offer(reliability=QosReliability.BEST_EFFORT)
    same = profile_from_offers("/tf", [latched, offer(durability=QosDurability.TRANSIENT_LOCAL, depth=7)])
    assert (same.reliability, same.durability) == (ReliabilityPolicy.RELIABLE, DurabilityPolicy.TRANSIENT_LOCAL)
    assert profile_from_offers("/scan", [sensor]).reliability == ReliabilityPolicy.BEST_EFFORT
    assert capsys.readouterr().err == ""
    mixed = profile_from_offers("/tf", [latched, sensor])
    assert (mixed.reliability, mixed.durability) == (ReliabilityPolicy.RELIABLE, DurabilityPolicy.VOLATILE)
    (line,) = capsys.readouterr().err.splitlines()
    assert "'/tf' had different QoS" in line


# --- discovery


def state(participants: int, names: str = "", nameless: int = 0) -> GraphState:
    return GraphState(participants, nameless, frozenset((name,) for name in names))


def test_a_graph_is_complete_when_all_have_answered_and_it_is_quiet():
    completion = Completion(0.0)
    assert not completion.reached(0.1, state(1), 3)
    assert not completion.reached(3.0, state(1), 3)  # quiet, but two are missing
    assert not completion.reached(3.1, state(3, "ab"), 3)
    assert not completion.reached(3.5, state(3, "abc"), 3)
    assert not completion.reached(3.4 + QUIET_TIME, state(3, "abc"), 3)
    assert completion.reached(3.5 + QUIET_TIME, state(3, "abc"), 3)


@pytest.mark.parametrize(("seen", "expected"), [(state(2), 3), (state(3, nameless=1), 3)])
def test_what_does_not_answer_is_waited_for_but_not_for_ever(seen, expected):
    completion = Completion(0.0)
    assert not completion.reached(1.0, seen, expected)
    assert not completion.reached(0.9 + PATIENCE, seen, expected)
    assert completion.reached(1.1 + PATIENCE, seen, expected)


def test_participants_are_counted_by_their_ports(tmp_path):
    row = "  12: {address}:{port:04X} 00000000:0000 07 00000000:00000000 00:00000000 00000000     0        0 1 2 0 0\n"
    ports = [7410 + 250 * 42, 7412 + 250 * 42, 7411 + 250 * 42, 7400 + 250 * 42, 7410 + 250 * 43, 53]
    (tmp_path / "udp").write_text("head\n" + "".join(row.format(address="0100007F", port=port) for port in ports))
    (tmp_path / "udp6").write_text("head\n" + row.format(address="0" * 32, port=7412 + 250 * 42))
    tables = [tmp_path / "udp", tmp_path / "udp6", tmp_path / "absent"]
    assert count_participants(42, tables) == 2
    assert count_participants(43, tables) == 1
    assert count_participants(44, tables) == 0


# --- topics


def test_the_rate_meter_knows_gaps_of_the_last_messages():
    meter = RateMeter(window=3)
    for now in (10.0, 10.5, 10.55, 10.6, 10.65):
        meter.message_at(now)
        assert meter.report() is None  # not before a second has passed
    meter.message_at(11.55)
    rate = meter.report()
    assert str(rate) == "average rate: 3.000\n\tmin: 0.050s max: 0.900s std dev: 0.40069s window: 3"
    meter.message_at(1.0)  # the clock went back
    assert meter.report() is None


def test_qos_flags_offer_what_the_library_knows():
    assert set(qos.PROFILES) == set(QoSPresetProfiles.short_keys())
    for choices, policy in [
        (qos.HISTORIES, HistoryPolicy),
        (qos.RELIABILITIES, ReliabilityPolicy),
        (qos.DURABILITIES, DurabilityPolicy),
        (qos.LIVELINESSES, LivelinessPolicy),
    ]:
        assert set(choices) == set(policy.short_keys())


def test_qos_flags_override_parts_of_the_preset():
    parser = argparse.ArgumentParser()
    qos.add_qos_arguments(parser, "sensor_data")
    plain = qos.profile_from_flags(parser.parse_args([]))
    assert (plain.depth, plain.reliability) == (5, ReliabilityPolicy.BEST_EFFORT)
    chosen = qos.profile_from_flags(
        parser.parse_args(["--qos-profile", "default", "--qos-depth", "7", "--qos-durability", "transient_local"])
    )
    assert (chosen.depth, chosen.reliability) == (7, ReliabilityPolicy.RELIABLE)
    assert chosen.durability == DurabilityPolicy.TRANSIENT_LOCAL
    assert plain.depth == 5, "presets are not changed"


# --- interfaces


@pytest.fixture
def package(tmp_path, monkeypatch):
    """A package of one message that has all kinds of lines."""
    (tmp_path / "share/ament_index/resource_index/packages").mkdir(parents=True)
    (tmp_path / "share/ament_index/resource_index/packages/show_msgs").touch()
    (tmp_path / "share/show_msgs/msg").mkdir(parents=True)
    (tmp_path / "share/show_msgs/msg/Inner.msg").write_text("# inner\n\nint8[<=3] few  # three\n")
    (tmp_path / "share/show_msgs/msg/Outer.msg").write_text(
        '# outer\n\nInner[] items # many\nstring<=5 text "a # b" # said\nuint8 LAST=7\nshow_msgs/Inner one\n'
    )
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(tmp_path))
    return tmp_path


def test_interfaces_are_shown_with_what_is_nested(package):
    inner = ["\tint8[<=3] few"]
    assert list(definition("show_msgs/msg/Outer", comments=True, nested_comments=False)) == [
        "# outer", "", "Inner[] items # many", *inner, 'string<=5 text "a # b" # said', "uint8 LAST=7",
        "show_msgs/Inner one", *inner,
    ]  # fmt: skip
    assert list(definition("show_msgs/msg/Outer", comments=False, nested_comments=False)) == [
        "Inner[] items", *inner, 'string<=5 text "a # b"', "uint8 LAST=7", "show_msgs/Inner one", *inner,
    ]  # fmt: skip
    everything = list(definition("show_msgs/msg/Outer", comments=True, nested_comments=True))
    assert everything[3:6] == ["\t# inner", "", "\tint8[<=3] few  # three"]


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("show_msgs/msg/None", "Could not find the interface 'show_msgs/msg/None'"),
        ("no_msgs/msg/None", "Unknown package 'no_msgs'"),
        ("show_msgs/Inner", "Invalid name 'show_msgs/Inner'"),
        ("show_msgs/lib/Inner", "Invalid name 'show_msgs/lib/Inner'"),
    ],
)
def test_interfaces_that_are_not_there(package, name, message):
    with pytest.raises(CommandError, match=message):
        find_definition(name)


def test_no_part_of_the_command_needs_a_package_of_the_workspace_but_the_core():
    root = Path(__file__).parents[1]
    packages = {path.name for path in (root / "src").iterdir() if path.is_dir()} - {"underlay"}
    for file in (root / "tools/ros2").rglob("*.py"):
        for line in file.read_text().splitlines():
            words = line.split()
            if words[:1] in (["import"], ["from"]):
                assert words[1].split(".")[0] not in packages - {"cliport_core"}, (file.name, line)


@pytest.mark.parametrize(("driver", "drives"), [("franky", True), ("ros2_control", False)])
def test_a_real_arms_launch_file_starts_its_driver_and_names_its_preset_everywhere(driver: str, drives: bool) -> None:
    launch = LaunchDescription({"arm": "fr3", "driver": driver, "robot_ip": "172.16.0.2", "camera": "realsense"})
    launch.load(BRINGUP / "launch/real.launch.yaml")
    nodes = {Path(process.command[0]).name: process for process in launch.processes}
    assert ("driver" in nodes) == drives
    if drives:
        given = _own_parameters(nodes["driver"])
        assert (given["robot_ip"], given["arm"], given["realtime"]) == ("172.16.0.2", "fr3", True)
        assert (given["gripper"], given["load_mass"], given["load_center"]) == (True, 0.0, [0.0, 0.0, 0.0])
        assert (given["publish_clock"], given["use_sim_time"]) == (False, False)
    for name in ("perception", "executor", "guard", "server"):
        files = [part for part in nodes[name].parameters if isinstance(part, str)]
        assert [Path(file).name for file in files] == ["policy.yaml", "fr3.yaml"]
    assert _own_parameters(nodes["executor"])["auto_approve"] is False
    assert any("/camera/camera/color/camera_info" in part for part in nodes["perception"].command)


def test_a_simulated_arms_time_is_that_of_every_node_of_the_launch_file() -> None:
    arguments = {"robot_ip": "127.0.0.1", "realtime": "false", "publish_clock": "true", "load_mass": "0.3"}
    launch = LaunchDescription(arguments | {"gripper": "false", "load_center": "[0.0, 0.0, 0.05]"})
    launch.load(BRINGUP / "launch/real.launch.yaml")
    nodes = {Path(process.command[0]).name: _own_parameters(process) for process in launch.processes}
    assert {name: given["use_sim_time"] for name, given in nodes.items()} == dict.fromkeys(nodes, True)
    given = nodes["driver"]
    assert (given["publish_clock"], given["realtime"], given["gripper"]) == (True, False, False)
    assert (given["load_mass"], given["load_center"]) == (0.3, [0.0, 0.0, 0.05])


def _own_parameters(process: ProcessPlan) -> dict[str, object]:
    """Return the parameters that a launch file gives by value."""
    return {key: value for part in process.parameters if isinstance(part, dict) for key, value in part.items()}
