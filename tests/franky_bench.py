"""The arm behind its own protocol, the driver and the executor as processes, and a client in place of the camera."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from array import array
from collections.abc import Callable
from contextlib import ExitStack
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import rclpy
from control_msgs.action import FollowJointTrajectory
from geometry_msgs.msg import Point, Pose, Quaternion, TransformStamped
from numpy.typing import NDArray
from rclpy.action import ActionClient
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile, qos_profile_sensor_data
from sensor_msgs.msg import CameraInfo, JointState, PointCloud2
from std_msgs.msg import String
from std_srvs.srv import Trigger
from tf2_msgs.msg import TFMessage

from cliport_core import topics
from cliport_core.heartbeat import Heartbeat
from cliport_core.ros_running import SpinThread
from cliport_interfaces.action import PickPlace
from cliport_perception.clouds import POINT_STEP
from cliport_perception.conversions import cloud_to_msg
from panda_model import load_preset

HERE = Path(__file__).resolve().parent
FR3 = load_preset("fr3")
BLOCK_SIZE = 0.04  # of the server's block [m]
PATIENCE = 600.0  # for one goal, wall clock [s]: the simulated arm may run at a tenth of real time
# The simulated joints rub with up to 1.1 N m, which its server does not compensate as an arm's own controller does.
STIFFNESS = [1200.0, 1200.0, 1200.0, 1200.0, 250.0, 150.0, 50.0]  # twice the default but for the wrist [N m/rad]
_CAMERA = "camera_color_optical_frame"
_OWNER = "franky_bench"
_STEP = 0.004  # between two points of the cloud [m]
# The machine may be busy with the simulated arm itself; a real one computes elsewhere.
PATIENT = {"owner_silence": 5.0, "work_silence": 2.0, "max_cloud_age": 30.0, "max_joint_age": 1.0, "max_ahead": 1.0}


class Processes:
    """Processes of one test, with their output in files; ended together."""

    def __init__(self, folder: Path, domain: int) -> None:
        self._folder, self._stack = folder, ExitStack()
        self.environment = os.environ | {"ROS_DOMAIN_ID": str(domain)}
        self.running: dict[str, subprocess.Popen[Any]] = {}

    def start(self, name: str, *command: str, talks: bool = False) -> subprocess.Popen[Any]:
        """Start Python with these arguments; talks: its standard streams are pipes."""
        streams: dict[str, Any] = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE} if talks else {}
        log = self._stack.enter_context((self._folder / f"{name}.log").open("w"))
        streams.setdefault("stdout", log)
        process = subprocess.Popen(
            [sys.executable, *command], stderr=log, text=True, env=self.environment, **streams
        )  # fmt: skip
        self.running[name] = process
        self._stack.callback(_end, process)
        return process

    def node(self, name: str, module: str, **parameters: object) -> subprocess.Popen[Any]:
        """Start a node by its module's main, with parameters."""
        given = [text for key, value in parameters.items() for text in ("-p", f"{key}:={_yaml(value)}")]
        main = f"import sys; from {module} import main; sys.exit(main())"
        return self.start(name, "-c", main, "--ros-args", *given)

    def log(self, name: str) -> str:
        """Return what a process has written so far."""
        return (self._folder / f"{name}.log").read_text()

    def close(self) -> None:
        """End all of them, the newest first."""
        self._stack.close()


def _end(process: subprocess.Popen[Any]) -> None:
    process.terminate()
    try:
        process.wait(15.0)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()


def _yaml(value: object) -> str:
    return str(value).lower() if isinstance(value, bool) else str(value)


class TableArm:
    """The server of `franky_table_server.py`: its address, and what can be asked of it."""

    def __init__(self, processes: Processes, *options: str) -> None:
        self.process = processes.start("server", str(HERE / "franky_table_server.py"), *options, talks=True)
        self.address = self._answer("address")[0]

    def ask(self, what: str) -> None:
        """Ask for a fault, or its end."""
        self.process.stdin.write(f"{what}\n")
        self.process.stdin.flush()

    def block(self) -> NDArray[np.float64]:
        """Return the block's pose: position (3,) [m] and quaternion w, x, y, z (4,)."""
        self.ask("where")
        return np.array([float(word) for word in self._answer("block")])

    def _answer(self, head: str) -> list[str]:
        for line in self.process.stdout:
            words = line.split()
            if words[:1] == [head]:
                return list(words[1:])
        raise AssertionError(f"the server ended without '{head}'")


class ArmUser:
    """A client of driver and executor, which also publishes what a camera beyond the table would see."""

    def __init__(self, domain: int, sim_time: bool = True) -> None:
        self._context = rclpy.Context()
        self._context.init(domain_id=domain)
        overrides = [Parameter("use_sim_time", value=sim_time)]
        self.node = rclpy.create_node("franky_bench", context=self._context, parameter_overrides=overrides)
        self.joints: list[tuple[float, float, NDArray[np.float64]]] = []  # (wall, stamp [s], positions)
        self.followed: dict[bytes, list[tuple[list[float], list[float]]]] = {}  # by goal: desired, actual
        self.node.create_subscription(JointState, topics.JOINT_STATES, self._on_joints, qos_profile_sensor_data)
        kind = FollowJointTrajectory.Impl.FeedbackMessage
        self.node.create_subscription(kind, f"{FR3.arm_action}/_action/feedback", self._on_feedback, 100)
        self._clouds = self.node.create_publisher(PointCloud2, topics.POINTS, QoSProfile(depth=1))
        self._infos = self.node.create_publisher(CameraInfo, topics.CAMERA_INFO, 5)
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self._place = self.node.create_publisher(TFMessage, topics.TF_STATIC, latched)
        self._place.publish(TFMessage(transforms=[_camera_beyond_the_table()]))
        beats = self.node.create_publisher(String, topics.OWNER_HEARTBEAT, 10)
        self._heart = Heartbeat(lambda: beats.publish(String(data=_OWNER)))
        self.pick_place = ActionClient(self.node, PickPlace, topics.PICK_PLACE)
        self._points: array[int] | None = None
        self._seen_at = self.node.get_clock().now()  # the goal's observation: an older cloud shows the last scene
        self.node.create_timer(0.2, self._look)
        self._spinner = SpinThread(self.node, lambda _: None, self._context)

    def close(self) -> None:
        """Leave the graph."""
        self._heart.stop()
        self._spinner.stop()
        self.node.destroy_node()
        self._context.try_shutdown()

    def see(self, block: NDArray[np.float64]) -> None:
        """Let the clouds show the table and the block at a pose, as TableArm gives it."""
        ticks = np.arange(0.25, 0.65, _STEP), np.arange(-0.3, 0.3, _STEP), [0.0]
        table = np.array(list(product(*ticks)))
        table = table[np.abs(table[:, :2] - block[:2]).max(axis=1) > 0.75 * BLOCK_SIZE]
        half = BLOCK_SIZE / 2.0
        side = np.linspace(-half, half, int(BLOCK_SIZE / _STEP) + 1)
        faces = np.array([point for point in product(side, side, side) if max(map(abs, point)) > half - 1e-9])
        w, x, y, z = block[3:7]
        yaw = np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
        turn = np.array([[np.cos(yaw), -np.sin(yaw), 0.0], [np.sin(yaw), np.cos(yaw), 0.0], [0.0, 0.0, 1.0]])
        points = np.vstack([table, faces @ turn.T + block[:3]])
        rows = np.zeros((len(points), POINT_STEP // 4), np.float32)
        rows[:, :3] = points
        self._points = array("B", rows.tobytes())
        before = self.node.get_clock().now()
        self.wait(lambda: self.node.get_clock().now() > before, 30.0)  # a cloud of the last scene may have this stamp
        self._seen_at = self.node.get_clock().now()

    def trigger(self, name: str, seconds: float = 60.0) -> str:
        """Call a service; return its message."""
        client = self.node.create_client(Trigger, name)
        assert client.wait_for_service(seconds), f"no service {name}"
        return str(self.result(client.call_async(Trigger.Request()), seconds).message)

    def move_block(self, pick: NDArray[np.float64], place: tuple[float, float]) -> PickPlace.Result:
        """Have a block at a pose picked and placed; return the executor's result."""
        w, z = pick[3], pick[6]
        goal = PickPlace.Goal(instruction="move the block", owner=_OWNER)
        goal.header.frame_id, goal.header.stamp = FR3.base_frame, self._seen_at.to_msg()
        goal.pick = _pose(pick[0], pick[1], w, z)
        goal.place = _pose(*place, 1.0, 0.0)
        handle = self.result(self.pick_place.send_goal_async(goal), 60.0)
        assert handle.accepted
        return self.result(handle.get_result_async(), PATIENCE).result

    def result(self, future: Any, seconds: float) -> Any:
        """Wait for a future and return what it holds."""
        self.wait(future.done, seconds)
        return future.result()

    def wait(self, condition: Callable[[], bool], seconds: float) -> None:
        """Wait until a condition holds; fail where it does not."""
        deadline = time.monotonic() + seconds
        while not condition():
            assert time.monotonic() < deadline, "it never came"
            time.sleep(0.01)

    def _look(self) -> None:
        now = self.node.get_clock().now()
        if self._points is None or now.nanoseconds == 0:
            return
        self._clouds.publish(cloud_to_msg(self._points, FR3.base_frame, now.nanoseconds))
        info = CameraInfo()
        info.header.frame_id, info.header.stamp = _CAMERA, now.to_msg()
        self._infos.publish(info)

    def _on_joints(self, message: JointState) -> None:
        stamp = message.header.stamp.sec + 1e-9 * message.header.stamp.nanosec
        self.joints.append((time.monotonic(), stamp, np.array(message.position)))

    def _on_feedback(self, message: Any) -> None:
        feedback = message.feedback
        pair = (list(feedback.desired.positions), list(feedback.actual.positions))
        self.followed.setdefault(bytes(message.goal_id.uuid), []).append(pair)


def _pose(x: float, y: float, w: float, z: float) -> Pose:
    return Pose(position=Point(x=float(x), y=float(y)), orientation=Quaternion(w=float(w), z=float(z)))


def _camera_beyond_the_table() -> TransformStamped:
    place = TransformStamped(child_frame_id=_CAMERA)
    place.header.frame_id = FR3.base_frame
    place.transform.translation.x, place.transform.translation.z = 1.1, 0.9  # its post is clear of the arm
    place.transform.rotation.x = 1.0  # it looks down
    place.transform.rotation.w = 0.0
    return place
