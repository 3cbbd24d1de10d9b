"""What the simulated camera and arm say, as messages of a bag, without ROS."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from cliport_episodes.message_types import encode, known_types
from cliport_episodes.raw import RawMessage
from cliport_perception import CameraModel, Pose
from sim_bridge.panda import ARM_JOINT_NAMES, FINGER_JOINT_NAMES, ArmState
from sim_bridge.rendering.camera import OPTICAL_FRAME, RgbdFrame

BASE_FRAME = "panda_link0"
COLOR_TOPIC = "/camera/color/image_raw"
INFO_TOPIC = "/camera/color/camera_info"
DEPTH_TOPIC = "/camera/aligned_depth_to_color/image_raw"
TF_TOPIC = "/tf_static"
JOINTS_TOPIC = "/joint_states"
_NS = 1_000_000_000
_LATENCY_NS = 40_000_000
_FARTHEST = 65.0  # [m]: what 16UC1 holds


def observation_messages(
    frame: RgbdFrame, camera: CameraModel, camera_in_base: Pose, state: ArmState, stamp_ns: int
) -> list[RawMessage]:
    """Everything that an observation is made of, with one stamp [ns]: depth as 16UC1, as a RealSense gives it.

    The images are received a little later than the rest, so that a replay has that when they come.
    """
    depth = np.where(np.isfinite(frame.depth) & (frame.depth < _FARTHEST), frame.depth, 0.0)
    return [
        _static_transform(camera_in_base, stamp_ns),
        _joint_state(state, stamp_ns),
        _camera_info(camera, stamp_ns),
        replace(_image(COLOR_TOPIC, frame.color, "rgb8", stamp_ns), stamp_ns=stamp_ns + _LATENCY_NS),
        replace(
            _image(DEPTH_TOPIC, np.rint(1000.0 * depth).astype("<u2"), "16UC1", stamp_ns),
            stamp_ns=stamp_ns + _LATENCY_NS,
        ),
    ]


def _image(topic: str, pixels: npt.NDArray[np.generic], encoding: str, stamp_ns: int) -> RawMessage:
    height, width = pixels.shape[:2]
    data = np.ascontiguousarray(pixels).reshape(height, -1).view(np.uint8)
    message = known_types().types["sensor_msgs/msg/Image"](
        header=_header(stamp_ns, OPTICAL_FRAME),
        height=height,
        width=width,
        encoding=encoding,
        is_bigendian=0,
        step=data.shape[1],
        data=data.reshape(-1),
    )
    return encode(topic, message, stamp_ns)


def _camera_info(camera: CameraModel, stamp_ns: int) -> RawMessage:
    """Of an unrectified monocular camera."""
    types = known_types().types
    projection = np.zeros((3, 4))
    projection[:, :3] = camera.matrix
    message = types["sensor_msgs/msg/CameraInfo"](
        header=_header(stamp_ns, OPTICAL_FRAME),
        height=camera.height,
        width=camera.width,
        distortion_model=camera.distortion_model,
        d=np.array(camera.distortion or [0.0] * 5),
        k=camera.matrix.reshape(-1),
        r=np.eye(3).reshape(-1),
        p=projection.reshape(-1),
        binning_x=0,
        binning_y=0,
        roi=types["sensor_msgs/msg/RegionOfInterest"](x_offset=0, y_offset=0, height=0, width=0, do_rectify=False),
    )
    return encode(INFO_TOPIC, message, stamp_ns)


def _static_transform(camera_in_base: Pose, stamp_ns: int) -> RawMessage:
    types = known_types().types
    x, y, z = (float(v) for v in camera_in_base.translation)
    qx, qy, qz, qw = (float(v) for v in camera_in_base.as_quaternion_xyzw())
    transform = types["geometry_msgs/msg/TransformStamped"](
        header=_header(stamp_ns, BASE_FRAME),
        child_frame_id=OPTICAL_FRAME,
        transform=types["geometry_msgs/msg/Transform"](
            translation=types["geometry_msgs/msg/Vector3"](x=x, y=y, z=z),
            rotation=types["geometry_msgs/msg/Quaternion"](x=qx, y=qy, z=qz, w=qw),
        ),
    )
    return encode(TF_TOPIC, types["tf2_msgs/msg/TFMessage"](transforms=[transform]), stamp_ns)


def _joint_state(state: ArmState, stamp_ns: int) -> RawMessage:
    message = known_types().types["sensor_msgs/msg/JointState"](
        header=_header(stamp_ns, ""),
        name=[*ARM_JOINT_NAMES, *FINGER_JOINT_NAMES],
        position=np.concatenate([state.positions, state.finger_positions]),
        velocity=np.concatenate([state.velocities, state.finger_velocities]),
        effort=np.concatenate([state.efforts, np.zeros(2)]),
    )
    return encode(JOINTS_TOPIC, message, stamp_ns)


def _header(stamp_ns: int, frame_id: str) -> Any:
    types = known_types().types
    time = types["builtin_interfaces/msg/Time"](sec=stamp_ns // _NS, nanosec=stamp_ns % _NS)
    return types["std_msgs/msg/Header"](stamp=time, frame_id=frame_id)
