"""`calibrate --verify` over ROS: one frame, one picture, a few numbers."""

from __future__ import annotations

import argparse
import time
from contextlib import suppress
from pathlib import Path

from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from tf2_msgs.msg import TFMessage

from cliport_core import messages, topics
from cliport_core.errors import FrameError
from cliport_core.image_files import encode_png
from cliport_core.ros_compressed import color_of_raw, depth_of_raw
from cliport_core.ros_rgbd import RawFrame, RgbdInput
from cliport_core.transforms import TransformTree
from cliport_core.workspace import WorkspaceSpec
from cliport_perception.calibration.board import Board
from cliport_perception.calibration.calibration_file import CalibrationRecord, load_calibration
from cliport_perception.calibration.depth_application import apply_depth
from cliport_perception.calibration.depth_check import check_depth
from cliport_perception.calibration.detection import BoardDetector
from cliport_perception.calibration.ros_session import ros_session
from cliport_perception.calibration.saving import say_saved
from cliport_perception.calibration.verification import Frame, draw, tip_of, verify
from cliport_perception.calibration.view import BoardView
from cliport_perception.camera_model import CameraModel
from cliport_perception.conversions import CameraReader
from cliport_perception.depth_correction import AS_MEASURED
from cliport_perception.errors import CalibrationError
from cliport_perception.frame_preparation import FramePreparation, PreparedFrame
from panda_model.preset_files import load_preset

_WAIT_S = 15.0
_LISTEN_S = 1.0  # for /tf, after the first frame


class OneFrame(Node):
    """Keeps the newest frame of the camera, and the frames of /tf."""

    def __init__(self) -> None:
        super().__init__("calibrate_verify")
        self.frame: RawFrame | None = None
        self.fault = "nothing received from the camera"
        self.tree = TransformTree()
        latched = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self.create_subscription(TFMessage, topics.TF_STATIC, self._on_tf, latched)
        self.create_subscription(TFMessage, topics.TF, self._on_tf, 100)
        self.compressed = bool(self.declare_parameter("compressed", False).value)
        self.models = CameraReader(bool(self.declare_parameter("rectified", False).value))
        depth_info = str(self.declare_parameter("depth_camera_info", "").value)
        self._camera = RgbdInput(self, self._take, self._complain, compressed=self.compressed, depth_info=depth_info)
        self.create_timer(1.0, self._camera.adapt)

    def images(self, frame: RawFrame, camera: CameraModel) -> PreparedFrame:
        """Return a frame's colour, and its depth in the colour camera's image. Raises CoreError where that fails."""
        color = color_of_raw(frame.color.data, self.compressed)
        depth = depth_of_raw(frame.depth.data, self.compressed)
        if frame.depth_info is None:
            return PreparedFrame(color, depth, camera)
        depth_in_color = self.tree.source_in_target(frame.depth_frame_id, frame.frame_id)
        depth_camera = self.models.read(frame.depth_info.data)
        return FramePreparation().unaligned(color, depth, camera, depth_camera, depth_in_color)

    def _take(self, frame: RawFrame) -> None:
        self.frame = frame

    def _complain(self, fault: str) -> None:
        self.fault = fault

    def _on_tf(self, message: TFMessage) -> None:
        for link in message.transforms:
            try:
                pose = messages.pose_from_transform_msg(link.transform)
            except ValueError:
                continue  # perception says so
            self.tree.put(link.header.frame_id, link.child_frame_id, pose)


def run_verify(board: Board, options: argparse.Namespace, ros_args: list[str]) -> int:
    """Take one frame, write the picture, if one is wanted, and print the numbers; return the exit status.

    Raises:
        CalibrationError: without a calibration or a frame, when nothing of the workspace is seen, or when depth is to
            be applied and cannot be.
        CoreError: when the frame or the workspace cannot be used.
    """
    record = load_calibration(options.calibration)
    workspace = WorkspaceSpec.load(options.workspace) if options.workspace else WorkspaceSpec()
    frame = _one_frame(record, board, options, ros_args)
    found = verify(frame, record.camera, workspace, board)
    checked = None
    if found.plane is not None:
        checked = check_depth(frame.depth, frame.board, record.camera, workspace, found.plane)
    depth_words = ["depth: too little of the table is seen"] if checked is None else checked.in_words(record.base_frame)
    if record.depth is not None:
        depth_words.append(f"depth was corrected as {options.calibration} says before all this")
    print("\n".join([*found.in_words(), *depth_words]))
    if options.verify is not None:
        _write(options.verify, encode_png(draw(found, frame, record.camera, board)))
    if options.apply_depth:
        applied = apply_depth(checked, frame, record, workspace)
        print("\n".join(applied.in_words()))
        return say_saved(options.calibration, applied.record)
    return 0


def _write(path: Path, picture: bytes) -> None:
    try:
        path.write_bytes(picture)
    except OSError as error:
        raise CalibrationError(f"cannot write {path}: {error.strerror}") from None
    print(path)


def _one_frame(record: CalibrationRecord, board: Board, options: argparse.Namespace, ros_args: list[str]) -> Frame:
    """Return the camera's next frame, its depth corrected as the record says.

    Raises:
        CalibrationError: when no frame comes.
        CoreError: when it cannot be used.
    """
    gripper = options.gripper_frame or load_preset(options.robot).tcp_frame
    with ros_session(ros_args) as executor:
        node = OneFrame()
        executor.add_node(node)
        end = time.monotonic() + _WAIT_S
        while node.frame is None and time.monotonic() < end:
            executor.spin_once(timeout_sec=0.1)
        end = time.monotonic() + _LISTEN_S
        while node.frame is not None and time.monotonic() < end:
            executor.spin_once(timeout_sec=0.1)
        if node.frame is None:
            raise CalibrationError(f"no frame in {_WAIT_S:.0f} s: {node.fault}")
        seen = node.images(node.frame, record.camera.intrinsics)
        tip = None
        with suppress(FrameError):
            tip = tip_of(node.tree.source_in_target(gripper, record.base_frame))
    look = BoardDetector(board, record.camera.intrinsics).look(seen.color)
    depth = (record.depth or AS_MEASURED).apply(seen.depth_m)
    return Frame(seen.color, depth, tip, look if isinstance(look, BoardView) else None)
