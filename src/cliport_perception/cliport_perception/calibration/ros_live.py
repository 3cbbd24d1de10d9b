"""The live procedure over ROS: camera and /tf in, a saved calibration out; headless."""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from datetime import datetime, timezone

import numpy as np
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import CameraInfo
from tf2_msgs.msg import TFMessage

from cliport_core import messages, topics
from cliport_core.adaptive_subscription import AdaptiveSubscription
from cliport_core.errors import CoreError
from cliport_core.pose import Pose
from cliport_perception.calibration.board import Board
from cliport_perception.calibration.calibration_file import CalibrationRecord, Method, is_frame_name
from cliport_perception.calibration.gripper_feed import GripperFeed, Link
from cliport_perception.calibration.known_board import board_from_touches
from cliport_perception.calibration.lens_file import read_lens
from cliport_perception.calibration.procedures import EyeOnBaseProcedure, KnownBoardProcedure, Procedure, Voice
from cliport_perception.calibration.ros_moving import check_moving, moving
from cliport_perception.calibration.ros_pictures import RosPicture, subscribe_pictures
from cliport_perception.calibration.ros_session import ros_session, screen_voice
from cliport_perception.calibration.sample import MotionLimits
from cliport_perception.calibration.saving import DEFAULT_OUT, check_writable, say_saved
from cliport_perception.camera_model import CameraModel
from cliport_perception.conversions import camera_from_msg
from cliport_perception.errors import CalibrationError
from panda_model.preset_files import load_preset

_SILENT_S = 5.0

Start = Callable[[CameraModel], Procedure]


class LiveCalibration(Node):
    """Feeds a procedure, which begins once camera_info has said what the camera is."""

    def __init__(
        self, start: Start, frames: tuple[str, str], complain: Callable[[str], None], lens: CameraModel | None = None
    ) -> None:
        """Subscribe. frames: the base's and the gripper's; lens: in place of what camera_info says."""
        super().__init__("calibrate")
        self._start = start
        self._complain = complain
        self._feed = GripperFeed(*frames)
        self._seen: set[str] = set()
        self._rectified = bool(self.declare_parameter("rectified", False).value)
        self._lens_given = lens is not None
        self.camera: CameraModel | None = lens
        self.procedure: Procedure | None = None if lens is None else start(lens)
        self.camera_frame = ""
        latched = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self.create_subscription(TFMessage, topics.TF_STATIC, self._on_static, latched)
        self.create_subscription(TFMessage, topics.TF, self._on_tf, 100)
        self._inputs = (
            AdaptiveSubscription(self, CameraInfo, topics.CAMERA_INFO, self._on_info),
            subscribe_pictures(self, self._on_picture),
        )
        self.create_timer(1.0, self._adapt)
        self._began = time.monotonic()

    def _adapt(self) -> None:
        for subscription in self._inputs:
            subscription.adapt()
        needed = self._inputs[1:] if self._lens_given else self._inputs
        missing = [s.topic_name for s in needed if s.topic_name not in self._seen]
        if missing and time.monotonic() - self._began > _SILENT_S:
            self._complain(f"nothing received on {', '.join(missing)}: is the camera running, are the names remapped?")

    def _on_info(self, message: CameraInfo) -> None:
        self._seen.add(self._inputs[0].topic_name)
        if self._lens_given:
            return
        if not any(message.k):
            self._complain(
                "camera_info holds no K: calibrate the lens with --find-intrinsics, and give the file as --camera-info"
            )
            return
        try:
            camera = camera_from_msg(message, self._rectified)
        except CoreError as error:
            self._complain(f"camera_info cannot be used: {error}")
            return
        if self.camera is not None and camera != self.camera:
            self._complain("camera_info has changed since the procedure began: begin again for the new one")
            return
        if self.procedure is None:
            self.camera, self.procedure = camera, self._start(camera)

    def _on_picture(self, picture: RosPicture) -> None:
        self._seen.add(self._inputs[1].topic_name)
        if self.procedure is None:
            return
        try:
            stamp_ns, frame = picture.header
            if not is_frame_name(frame):
                raise CalibrationError(f"the pictures' frame_id is {frame!r}: set it to a frame's name, one word")
            self.camera_frame = frame
            self.procedure.on_picture(stamp_ns, picture.color())
        except CoreError as error:
            self._complain(str(error))

    def _on_static(self, message: TFMessage) -> None:
        self._feed.put(self._links(message))

    def _on_tf(self, message: TFMessage) -> None:
        news = self._feed.on_links(self._links(message))
        if news is not None and self.procedure is not None:
            self.procedure.on_gripper(*news)

    def _links(self, message: TFMessage) -> list[Link]:
        found = []
        for link in message.transforms:
            try:
                pose = messages.pose_from_transform_msg(link.transform)
            except ValueError as error:
                self._complain(f"the transform of '{link.child_frame_id}' is no rotation and is ignored: {error}")
                continue
            stamp_ns = messages.stamp_from_msg(link.header.stamp)
            found.append(Link(link.header.frame_id, link.child_frame_id, pose, stamp_ns))
        return found


def run_live(board: Board, options: argparse.Namespace, ros_args: list[str]) -> int:
    """Run the procedure that the options ask for until it is complete; return the exit status.

    Raises:
        CalibrationError: when no calibration follows. Nothing is overwritten then.
    """
    arm = load_preset(options.robot)
    base, gripper = options.base_frame or arm.base_frame, options.gripper_frame or arm.tcp_frame
    out = options.out or DEFAULT_OUT
    if not is_frame_name(base):
        raise CalibrationError(f"--base-frame is {base!r}: give a frame's name, one word")
    _check_count(options)
    check_moving(options)
    check_writable(out)
    voice = screen_voice()
    start = _start(board, options, voice)
    lens = None if options.camera_info is None else read_lens(options.camera_info)
    with ros_session(ros_args) as executor:
        node = LiveCalibration(start, (base, gripper), voice.complain, lens)
        executor.add_node(node)
        if options.move:
            with moving(node, lambda: node.procedure, base, board, options, voice) as step:
                record = _solved(node, executor, base, voice, step)
        else:
            record = _solved(node, executor, base, voice)
    return say_saved(out, record)


def _check_count(options: argparse.Namespace) -> None:
    known = options.board_at is not None or options.touched is not None
    least = 1 if known else MotionLimits().min_samples
    if options.samples < least:
        raise CalibrationError(f"--samples must be {least} or more, got {options.samples}")


def _solved(
    node: LiveCalibration,
    executor: SingleThreadedExecutor,
    base: str,
    voice: Voice,
    step: Callable[[], None] = lambda: None,
) -> CalibrationRecord:
    """Return the calibration; where more samples can mend a refusal, they are taken. Raises CalibrationError.

    step: called all the time while samples are taken.
    """
    while True:
        while node.procedure is None or not node.procedure.is_complete:
            executor.spin_once(timeout_sec=0.1)
            step()
        try:
            return node.procedure.solve((base, node.camera_frame), datetime.now(timezone.utc))
        except CalibrationError as error:
            more = node.procedure.extend()
            if not more:
                raise
            voice.say(f"nothing is saved yet: {error}; {more} more samples follow, those taken are kept")


def _start(board: Board, options: argparse.Namespace, voice: Voice) -> Start:
    if options.board_at is not None:
        place, method = Pose.from_xyz_rpy(options.board_at[:3], options.board_at[3:]), Method.FIXED_MARKER
    elif options.touched is not None:
        place, method = board_from_touches(board, np.reshape(options.touched, (3, 3))), Method.TOUCHED_POINTS
    else:
        rng = np.random.default_rng(options.seed)
        return lambda camera: EyeOnBaseProcedure(board, camera, options.samples, rng, voice, not options.move)
    return lambda camera: KnownBoardProcedure(board, place, camera, options.samples, method, voice)
