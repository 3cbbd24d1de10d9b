"""Log of motions: a line each, at its end, whatever ends it."""

from __future__ import annotations

import json
import math
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rclpy
from action_msgs.msg import GoalStatus, GoalStatusArray
from control_msgs.action import FollowJointTrajectory, GripperCommand
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import qos_profile_action_status_default
from ros_domain import next_domain
from sensor_msgs.msg import JointState

from panda_driver.errors import DriverError
from panda_driver.node_record_run import RunRecorder, main
from panda_driver.run_bag import RunBag
from panda_driver.run_log import RunLog
from panda_model import load_preset

EXECUTING, SUCCEEDED, CANCELED, ABORTED = 2, 4, 5, 6


def lines(path: Path) -> list[dict[str, Any]]:
    return [json.loads(line) for line in path.read_text().splitlines()]


@pytest.fixture
def said() -> list[str]:
    return []


@pytest.fixture
def log(tmp_path: Path, said: list[str]) -> RunLog:
    return RunLog(tmp_path / "motions.jsonl", {"arm": "fr3"}, said.append)


def test_a_motion_is_written_at_its_end(log: RunLog, tmp_path: Path, said: list[str]) -> None:
    log.on_status("a", "arm", 10.0, EXECUTING)
    log.on_feedback("a", "arm", 10.1, [0.0, 1.0], [0.01, 1.0], [])
    log.on_efforts([2.0, -7.0])
    log.on_feedback("a", "arm", 10.2, [0.5, 1.0], [0.5, 1.03], [])
    path = tmp_path / "motions.jsonl"
    assert lines(path) == [{"format": 1, "arm": "fr3"}]
    log.on_status("a", "arm", 10.5, SUCCEEDED)
    log.on_status("a", "arm", 10.6, SUCCEEDED)  # told again with every other goal
    log.on_feedback("a", "arm", 10.7, [0.0, 1.0], [0.0, 1.0], [])
    (motion,) = lines(path)[1:]
    assert motion == {
        "goal": "a", "part": "arm", "began": 10.0, "seconds": 0.5, "end": "succeeded", "worst_error": 0.03,
        "greatest_effort": [2.0, 7.0],
        "samples": [[0.1, [0.0, 1.0], [0.01, 1.0], []], [0.2, [0.5, 1.0], [0.5, 1.03], [2.0, -7.0]]],
    }  # fmt: skip
    assert said == ["arm succeeded after 0.50 s, 2 samples, at most 0.0300 off"]


def test_arm_and_hand_go_on_beside_each_other(log: RunLog, tmp_path: Path) -> None:
    log.on_feedback("h", "hand", 1.0, [], [0.04], [12.0])
    log.on_feedback("a", "arm", 1.1, [0.0], [math.nan], [])
    log.on_status("h", "hand", 1.5, ABORTED)
    log.on_status("a", "arm", 2.0, CANCELED)
    hand, arm = lines(tmp_path / "motions.jsonl")[1:]
    assert (hand["part"], hand["end"], hand["worst_error"], hand["greatest_effort"]) == (
        "hand",
        "aborted",
        None,
        [12.0],
    )
    assert hand["samples"] == [[0.0, [], [0.04], [12.0]]]
    assert (arm["end"], arm["worst_error"], arm["greatest_effort"]) == ("canceled", None, None)
    assert arm["samples"] == [[0.0, [0.0], [None], []]], "JSON knows no NaN"


def test_what_ended_before_and_what_has_not_ended(log: RunLog, tmp_path: Path, said: list[str]) -> None:
    log.on_status("old", "arm", 1.0, SUCCEEDED)
    log.on_status("new", "arm", 2.0, EXECUTING)
    log.close(3.0)
    log.close(4.0)
    (motion,) = lines(tmp_path / "motions.jsonl")[1:]
    assert (motion["goal"], motion["end"], motion["seconds"]) == ("new", "unfinished", 1.0)
    assert said == ["arm unfinished after 1.00 s, 0 samples"]


def test_times_are_kept_to_a_tenth_of_a_millisecond(log: RunLog, tmp_path: Path) -> None:
    log.on_feedback("a", "arm", 10.00006, [0.0], [0.1234567], [])
    log.on_feedback("a", "arm", 10.50002, [0.0], [0.0], [])
    log.on_efforts([1.00006])
    log.on_feedback("a", "arm", 11.0, [0.0], [0.0], [])
    log.on_status("a", "arm", 12.0, SUCCEEDED)
    (motion,) = lines(tmp_path / "motions.jsonl")[1:]
    assert (motion["began"], motion["seconds"]) == (10.0001, 1.9999)
    assert [sample[0] for sample in motion["samples"]] == [0.0, 0.5, 0.9999]
    assert motion["samples"][0][2] == [0.123457] and motion["worst_error"] == 0.123457
    assert motion["greatest_effort"] == [1.0001]


def test_a_long_motion_is_bounded(log: RunLog, tmp_path: Path) -> None:
    for tick in range(6100):
        log.on_feedback("a", "arm", 0.01 * tick, [0.0], [0.0], [])
    log.on_status("a", "arm", 61.0, SUCCEEDED)
    assert len(lines(tmp_path / "motions.jsonl")[1]["samples"]) == 6000


def test_nothing_is_written_over(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "run").mkdir()
    (tmp_path / "run/motions.jsonl").write_text("kept")
    with pytest.raises(DriverError, match=r"cannot write .*motions\.jsonl \(File exists\): choose another --out"):
        RunLog(tmp_path / "run/motions.jsonl", {}, print)
    assert main(["--out", str(tmp_path / "run")]) == 1
    assert capsys.readouterr().err == f"error: {tmp_path / 'run'} exists: choose another --out\n"
    assert main(["--arm", "pr2", "--out", str(tmp_path / "other")]) == 1
    assert "unknown robot 'pr2'" in capsys.readouterr().err and not (tmp_path / "other").exists()
    assert (tmp_path / "run/motions.jsonl").read_text() == "kept"


def test_a_disk_that_refuses_is_one_error_and_no_traceback_at_the_end(
    log: RunLog, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(_: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("panda_driver.run_log.os.fsync", full)
    log.on_status("a", "arm", 1.0, EXECUTING)
    failures: list[BaseException] = []
    recorder = RunRecorder.__new__(RunRecorder)
    recorder._log, recorder._fail, recorder._now = log, failures.append, lambda: 2.0  # type: ignore[method-assign]
    recorder.close()
    assert [str(failure) for failure in failures] == [
        f"cannot write {tmp_path / 'motions.jsonl'} (No space left on device)"
    ]


@pytest.mark.parametrize(
    ("ends", "words"),
    [
        ("trap 'exit 0' INT", "a bag"),
        ("trap 'exit 3' INT", "no whole bag: its recorder ended with status 3"),
        ("trap '' INT", "a bag that was not closed within 1 s and may be torn"),
    ],
)
def test_a_bag_is_recorded_beside_and_closed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, ends: str, words: str
) -> None:
    ros2 = tmp_path / "ros2"
    ros2.write_text(f'#!/bin/sh\n{ends}\necho "$@" > {tmp_path}/asked\nwhile true; do sleep 0.05; done\n')
    ros2.chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path), prepend=":")
    bag = RunBag(tmp_path / "bag", ["/a", "/b"], ends=1.0 if "''" in ends else 30.0)
    deadline = time.monotonic() + 30.0
    while not (tmp_path / "asked").exists() and time.monotonic() < deadline:
        time.sleep(0.01)
    assert bag.end() == words
    assert (tmp_path / "asked").read_text() == f"bag record -o {tmp_path}/bag --topics /a /b\n"


def test_without_ros2_no_bag_is_recorded_and_that_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    assert RunBag(tmp_path / "bag", ["/a"]).end() == "no bag, because there is no ros2 command here"


@pytest.fixture
def graph(tmp_path: Path) -> Iterator[tuple[Node, Path]]:
    """A node beside a recorder of an FR3's motions, and the recorder's file."""
    rclpy.init(domain_id=next_domain())
    path = tmp_path / "motions.jsonl"
    recorder, tester = RunRecorder(load_preset("fr3"), path, print), Node("tester")  # type: ignore[arg-type]
    executor = SingleThreadedExecutor()
    for node in (recorder, tester):
        executor.add_node(node)
    thread = threading.Thread(target=executor.spin)
    thread.start()
    yield tester, path
    executor.shutdown()
    thread.join()
    for node in (recorder, tester):
        node.destroy_node()
    rclpy.shutdown()


def test_it_hears_a_grasp_by_the_finger_joints(graph: tuple[Node, Path]) -> None:
    tester, path = graph
    robot = load_preset("fr3")
    quality = qos_profile_action_status_default
    statuses = tester.create_publisher(GoalStatusArray, f"{robot.grasp_action}/_action/status", quality)
    joints = tester.create_publisher(JointState, "/joint_states", 10)
    state = JointState(name=list(robot.finger_joints), position=[0.012, 0.012])

    def tell(status: int) -> None:
        told = GoalStatus(status=status)
        told.goal_info.goal_id.uuid = np.full(16, 3, dtype=np.uint8)
        statuses.publish(GoalStatusArray(status_list=[told]))

    deadline = time.monotonic() + 60.0
    while not (statuses.get_subscription_count() and joints.get_subscription_count()) and time.monotonic() < deadline:
        time.sleep(0.02)
    tell(GoalStatus.STATUS_EXECUTING)
    for _ in range(5):
        time.sleep(0.05)
        joints.publish(state)
    time.sleep(0.1)
    while len(path.read_text().splitlines()) < 2 and time.monotonic() < deadline:
        tell(SUCCEEDED)
        time.sleep(0.05)
    [motion] = lines(path)[1:]
    assert (motion["part"], motion["end"]) == ("grasp", "succeeded")
    assert motion["samples"] and motion["samples"][-1][2] == [0.024]


def test_it_hears_the_arm_and_the_hand(graph: tuple[Node, Path]) -> None:
    tester, path = graph
    robot = load_preset("fr3")
    arm = tester.create_publisher(
        FollowJointTrajectory.Impl.FeedbackMessage, f"{robot.arm_action}/_action/feedback", 10
    )
    hand = tester.create_publisher(GripperCommand.Impl.FeedbackMessage, f"{robot.gripper_action}/_action/feedback", 10)
    joints = tester.create_publisher(JointState, "/joint_states", 10)
    ends = {
        part: tester.create_publisher(GoalStatusArray, f"{action}/_action/status", qos_profile_action_status_default)
        for part, action in (("arm", robot.arm_action), ("hand", robot.gripper_action))
    }
    wanted = [0.1 * joint for joint in range(7)]
    moving = FollowJointTrajectory.Impl.FeedbackMessage()
    moving.goal_id.uuid = np.full(16, 1, dtype=np.uint8)
    moving.feedback.desired.positions, moving.feedback.actual.positions = wanted, [q + 0.25 for q in wanted]
    closing = GripperCommand.Impl.FeedbackMessage()
    closing.goal_id.uuid = np.full(16, 2, dtype=np.uint8)
    closing.feedback.position, closing.feedback.effort = 0.03, 20.0
    state = JointState(name=[*robot.finger_joints, *robot.arm_joints], effort=[0.0, 0.0, *range(7)])
    began = time.time()
    deadline = time.monotonic() + 60.0
    while len(path.read_text().splitlines()) < 3 and time.monotonic() < deadline:
        joints.publish(state)
        for _ in range(3):  # until they are heard, and so before the ends
            arm.publish(moving)
            hand.publish(closing)
            time.sleep(0.05)
        if all(publisher.get_subscription_count() for publisher in (arm, hand, joints, *ends.values())):
            for part, number, status in (("arm", 1, SUCCEEDED), ("hand", 2, ABORTED)):
                told = GoalStatus(status=status)
                told.goal_info.goal_id.uuid = np.full(16, number, dtype=np.uint8)
                ends[part].publish(GoalStatusArray(status_list=[told]))
    found = {motion["part"]: motion for motion in lines(path)[1:]}
    assert (found["arm"]["end"], found["arm"]["worst_error"]) == ("succeeded", 0.25)
    assert found["arm"]["goal"] == "01" * 16 and found["arm"]["samples"][-1][1] == [round(q, 6) for q in wanted]
    assert (found["hand"]["end"], found["hand"]["greatest_effort"]) == ("aborted", [20.0])
    assert all(began <= motion["began"] + 1e-3 and motion["seconds"] >= 0.0 for motion in found.values())
    assert json.loads(path.read_text().splitlines()[0])["began"] == pytest.approx(began, abs=60.0)
