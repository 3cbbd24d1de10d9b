"""Conversion of an observation to the messages that a camera and an arm would have sent."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from cliport_core import topics
from cliport_core.pose import Pose
from cliport_episodes.message_types import encode, make, make_header
from cliport_episodes.observation import Observation
from cliport_episodes.raw import RawMessage
from cliport_perception.camera_model import CameraModel

_MAX_DEPTH = 65.0  # below the largest depth of 16UC1, 65.535 m [m]


def messages_from_observation(
    observation: Observation,
    camera_frame: str,
    base_frame: str,
    *,
    received_ns: int | None = None,
    velocities: Sequence[float] = (),
    efforts: Sequence[float] = (),
) -> list[RawMessage]:
    """Return an observation as messages: /tf_static, joints, camera_info, colour and depth.

    Inverse of `observation_from_messages`. All have the observation's stamp, and are received then or at
    received_ns [ns]. Depth is 16UC1 as a RealSense sends it: whole millimetres, 0 where unknown. velocities, efforts:
    of the joints, in their order, where known.
    """
    stamp_ns, joints = observation.stamp_ns, observation.joint_positions
    header = make_header(stamp_ns, camera_frame)
    depth = np.where(observation.depth_m < _MAX_DEPTH, observation.depth_m, 0.0)
    joint_state = make(
        "sensor_msgs/msg/JointState",
        header=make_header(stamp_ns, ""),
        name=list(joints),
        position=np.array(list(joints.values()), np.float64),
        velocity=np.array(velocities, np.float64),
        effort=np.array(efforts, np.float64),
    )
    messages = {
        topics.TF_STATIC: _transform(observation.camera_in_base, make_header(stamp_ns, base_frame), camera_frame),
        topics.JOINT_STATES: joint_state,
        topics.CAMERA_INFO: _camera_info(observation.camera, header),
        topics.COLOR: _image(observation.color, "rgb8", header),
        topics.DEPTH: _image(np.rint(1000.0 * depth).astype("<u2"), "16UC1", header),
    }
    received = stamp_ns if received_ns is None else received_ns
    return [encode(topic, message, received) for topic, message in messages.items()]


def _transform(child_in_parent: Pose, header: Any, child_frame: str) -> Any:
    x, y, z = child_in_parent.translation.tolist()
    qx, qy, qz, qw = child_in_parent.as_quaternion_xyzw().tolist()
    transform = make(
        "geometry_msgs/msg/Transform",
        translation=make("geometry_msgs/msg/Vector3", x=x, y=y, z=z),
        rotation=make("geometry_msgs/msg/Quaternion", x=qx, y=qy, z=qz, w=qw),
    )
    link = make("geometry_msgs/msg/TransformStamped", header=header, child_frame_id=child_frame, transform=transform)
    return make("tf2_msgs/msg/TFMessage", transforms=[link])


def _camera_info(camera: CameraModel, header: Any) -> Any:
    """Return the CameraInfo of an unrectified monocular camera."""
    return make(
        "sensor_msgs/msg/CameraInfo",
        header=header,
        height=camera.height,
        width=camera.width,
        distortion_model=camera.distortion_model,
        d=np.array(camera.distortion or [0.0] * 5),
        k=camera.matrix.reshape(-1),
        r=np.eye(3).reshape(-1),
        p=np.hstack([camera.matrix, np.zeros((3, 1))]).reshape(-1),
        binning_x=0,
        binning_y=0,
        roi=make("sensor_msgs/msg/RegionOfInterest", x_offset=0, y_offset=0, height=0, width=0, do_rectify=False),
    )


def _image(pixels: npt.NDArray[np.generic], encoding: str, header: Any) -> Any:
    height, width = pixels.shape[:2]
    data = np.ascontiguousarray(pixels).reshape(-1).view(np.uint8)
    return make(
        "sensor_msgs/msg/Image",
        header=header,
        height=height,
        width=width,
        encoding=encoding,
        is_bigendian=0,
        step=data.size // height,
        data=data,
    )
