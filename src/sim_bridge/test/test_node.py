"""The simulator as other processes see it: one node, run for real, driven by a client of this process."""

import json
import os
import signal
import subprocess
import sys
import threading
import time

import numpy as np
import pytest
from ros_domain import next_domain

pytest.importorskip("rclpy", exc_type=ImportError)
pytest.importorskip("cliport_interfaces", exc_type=ImportError)
pytest.importorskip("control_msgs", exc_type=ImportError)

from action_msgs.msg import GoalStatus
from builtin_interfaces.msg import Duration
from control_msgs.action import FollowJointTrajectory, GripperCommand
from franka_msgs.action import Grasp, Homing, Move
from franka_msgs.msg import GraspEpsilon
from rclpy.action import ActionClient
from simulator_client import JOINTS, TASK, Client, swing
from std_msgs.msg import Empty
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectoryPoint

from cliport_interfaces.srv import GetScore
from sim_bridge.conversions import image_from_msg

DOMAIN = next_domain()
ENVIRONMENT = os.environ | {"ROS_DOMAIN_ID": str(DOMAIN)}
COMMAND = [sys.executable, "-m", "sim_bridge.node"]


def start_node(*arguments):
    return subprocess.Popen(
        [*COMMAND, "--ros-args", *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        env=ENVIRONMENT,
    )


@pytest.fixture(scope="module")
def log_path(tmp_path_factory):
    return tmp_path_factory.mktemp("sim") / "trajectories.jsonl"


@pytest.fixture(scope="module")
def client(log_path):
    process = start_node("-p", f"trajectory_log:={log_path}")
    client = Client(DOMAIN)
    try:
        client.until(lambda: process.poll() is None and client.joints and client.clock, 30.0)
        client.until(lambda: all(client.seen.values()), 20.0)
        assert client.arm.wait_for_server(10.0)
        assert client.hand.wait_for_server(10.0)
        assert client.reset.wait_for_service(10.0)
        yield client
    finally:
        client.close()
        process.send_signal(signal.SIGINT)
        output, _ = process.communicate(timeout=15.0)
    assert process.returncode == 0, output
    assert "Traceback" not in output, output


def test_topics(client):
    begin, joints_start = client.clock[-1][1], len(client.joints)
    client.until(lambda: client.clock[-1][1] > begin + 2.0, 60.0)
    joints = client.joints[joints_start:]
    stamps = np.array([stamp for _, stamp in client.clock])
    assert (np.diff(stamps) > 0.0).all()
    # by simulated time, of which a busy machine makes less; a message may be lost
    assert 60 < np.count_nonzero(stamps > begin) < 400
    assert 40 < len(joints) < 400
    assert sorted(joints[-1][1].name) == sorted([*JOINTS, "panda_finger_joint1", "panda_finger_joint2"])
    assert client.positions() == pytest.approx([0, -0.785, 0, -2.356, 0, 1.571, 0.785], abs=0.01)
    transform = client.seen["/tf_static"][-1][1].transforms[0]
    assert (transform.header.frame_id, transform.child_frame_id) == (
        "panda_link0",
        "camera_color_optical_frame",
    )


def test_images(client):
    color = client.seen["/camera/color/image_raw"][-1][1]
    pixels = image_from_msg(color)
    assert pixels.shape == (540, 960, 3)
    assert pixels.std() > 10
    assert color.header.frame_id == "camera_color_optical_frame"
    depth = image_from_msg(client.seen["/camera/aligned_depth_to_color/image_raw"][-1][1])
    assert depth.shape == (540, 960)
    assert np.isnan(depth).any()
    assert 0.5 < np.nanmedian(depth) < 2.0
    info = client.seen["/camera/color/camera_info"][-1][1]
    assert (info.width, info.height, info.k[0], info.distortion_model) == (960, 540, 540.0, "plumb_bob")


def test_a_trajectory(client, log_path):
    client.make_scene()
    start = client.positions()
    handle, feedback = client.send(swing(start, 0.4, 1.5))
    assert handle.accepted
    status, result = client.result(handle)
    assert (status, result.error_code, result.error_string) == (GoalStatus.STATUS_SUCCEEDED, 0, "")
    assert client.positions()[0] == pytest.approx(start[0] + 0.4, abs=0.01)
    assert len(feedback) >= 8
    assert max(abs(message.error.positions[0]) for message in feedback) < 0.05
    logged = json.loads(log_path.read_text().splitlines()[-1])
    assert logged["joint_names"] == JOINTS
    assert np.array(logged["positions"]).shape == np.array(logged["velocities"]).shape == (11, 7)


def test_cancel_holds_within_three_tenths_of_a_second(client):
    client.make_scene()
    handle, _ = client.send(swing(client.positions(), 1.0, 1.6))
    client.until(lambda: client.joints[-1][1].velocity[0] > 0.5, 60.0)
    cancel = handle.cancel_goal_async()
    status, _ = client.result(handle)  # by then the controller has heard it
    assert client.get(cancel).return_code == 0
    assert status == GoalStatus.STATUS_CANCELED
    held = client.rest(after=0.3)
    assert np.ptp(held) < 2e-3
    assert held[-1] < 0.9


def test_a_new_goal_aborts_the_old(client):
    client.make_scene()
    start = client.positions()
    first, _ = client.send(swing(start, 0.5, 3.0))
    time.sleep(0.2)
    goal = FollowJointTrajectory.Goal()
    goal.trajectory.joint_names = JOINTS
    rest = [0.0] * 7
    target = (start - 0.2 * np.eye(7)[0]).tolist()
    goal.trajectory.points = [
        JointTrajectoryPoint(positions=target, velocities=rest, accelerations=rest, time_from_start=Duration(sec=1))
    ]
    second, _ = client.send(goal)
    status, result = client.result(first)
    assert status == GoalStatus.STATUS_ABORTED
    assert "preempted" in result.error_string
    assert client.result(second)[0] == GoalStatus.STATUS_SUCCEEDED


def test_bad_goals(client):
    client.make_scene()
    goal = swing(client.positions(), 0.1, 1.0)
    goal.trajectory.joint_names = [*JOINTS[:6], "elbow"]
    assert not client.send(goal)[0].accepted
    jump = swing(client.positions() + 0.2, 0.1, 1.0)
    handle, _ = client.send(jump)
    status, result = client.result(handle)
    assert status == GoalStatus.STATUS_ABORTED
    assert "reflex" in result.error_string
    wide = GripperCommand.Goal()
    wide.command.position = 0.08
    assert not client.send(wide, client.hand)[0].accepted


def test_the_hand_takes_half_and_reports_all_of_the_width(client):
    client.make_scene()
    for half, width in ((0.01, 0.02), (0.04, 0.08)):
        goal = GripperCommand.Goal()
        goal.command.position, goal.command.max_effort = half, 20.0
        status, result = client.result(client.send(goal, client.hand)[0])
        assert status == GoalStatus.STATUS_SUCCEEDED
        assert result.position == pytest.approx(width, abs=2e-3)
        assert (result.reached_goal, result.stalled) == (True, False)


def test_the_hand_does_what_franka_msgs_ask_for(client):
    client.make_scene()
    goals = (
        (Move, "move", Move.Goal(width=0.02, speed=0.1)),
        (Grasp, "grasp", Grasp.Goal(width=0.0, speed=0.1, force=20.0, epsilon=GraspEpsilon(inner=0.08, outer=0.08))),
        (Homing, "homing", Homing.Goal()),
    )
    for kind, name, goal in goals:
        server = ActionClient(client.node, kind, f"/panda_gripper/{name}")
        status, result = client.result(client.send(goal, server)[0])
        assert (status, result.success, result.error) == (GoalStatus.STATUS_SUCCEEDED, True, ""), name
    stop = client.node.create_client(Trigger, "/panda_gripper/stop")
    assert stop.wait_for_service(10.0)
    future = stop.call_async(Trigger.Request())
    client.until(future.done, 30.0)
    assert future.result().success


def test_a_lost_heartbeat_holds_the_arm(client):
    client.make_scene()
    beating = threading.Event()
    beating.set()

    def beat():
        while beating.is_set():
            client.heartbeat.publish(Empty())
            time.sleep(0.05)

    beater = threading.Thread(target=beat, daemon=True)
    beater.start()
    time.sleep(0.5)
    handle, _ = client.send(swing(client.positions(), 1.0, 2.5))
    client.until(lambda: client.positions()[0] > 0.1, 60.0)
    beating.clear()
    beater.join()
    status, result = client.result(handle)
    assert status == GoalStatus.STATUS_ABORTED
    assert "heartbeat lost" in result.error_string
    held = client.rest()
    assert np.ptp(held) < 2e-3
    assert held[-1] < 0.95  # it did not go on to its end


def test_faults(client):
    client.make_scene()
    depth_topic = "/camera/aligned_depth_to_color/image_raw"
    client.set(freeze_camera=True)
    time.sleep(0.4)
    frames = len(client.seen[depth_topic])
    time.sleep(0.8)
    assert len(client.seen[depth_topic]) == frames
    client.set(freeze_camera=False, depth_all_nan=True)
    client.until(lambda: np.isnan(image_from_msg(client.seen[depth_topic][-1][1])).all(), 5.0)
    client.set(depth_all_nan=False, abort_next_trajectory=True)
    start = client.positions()
    status, result = client.result(client.send(swing(start, 0.6, 2.0))[0])
    assert status == GoalStatus.STATUS_ABORTED
    assert "injected" in result.error_string
    time.sleep(0.4)
    status, _ = client.result(client.send(swing(client.positions(), 0.2, 1.0))[0])
    assert status == GoalStatus.STATUS_SUCCEEDED
    client.until(lambda: not np.isnan(image_from_msg(client.seen[depth_topic][-1][1])).all(), 5.0)


def test_reset_and_score(client):
    answer = client.make_scene(seed=3)
    assert answer.success, answer.message
    assert "bowl" in answer.instruction
    assert answer.max_steps > 0
    score = client.get(client.score.call_async(GetScore.Request()))
    assert (score.success, score.task, score.split, score.seed) == (True, TASK, "test", 3)
    assert (score.score, score.done) == (0.0, False)
    bad = client.make_scene(task="put-blocks-in-bowls-seen-colours")
    assert not bad.success
    assert TASK in bad.message
    assert "\n" not in bad.message
    assert not client.make_scene(seed=-1).success
    again = client.get(client.score.call_async(GetScore.Request()))
    assert again.seed == 3


def test_reset_ends_a_running_motion(client):
    client.make_scene()
    handle, _ = client.send(swing(client.positions(), 0.8, 6.0))
    client.until(lambda: client.positions()[0] > 0.05, 60.0)
    client.make_scene()
    status, result = client.result(handle)
    assert status == GoalStatus.STATUS_ABORTED
    assert "reset" in result.error_string
    assert client.positions()[0] == pytest.approx(0.0, abs=0.01)
