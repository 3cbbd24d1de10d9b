"""A camera, an arm and a person, as far as a recorder sees them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cliport_episodes.capture_setup import CaptureSetup
from cliport_episodes.data_set import DataSet
from cliport_episodes.demonstration import PixelBox, Source, StepRecord
from cliport_episodes.message_types import encode, known_types
from cliport_episodes.raw import RawMessage
from cliport_episodes.writer import EpisodeWriter
from cliport_perception.camera_model import CameraModel
from cliport_perception.pose import PlanarPose, Pose
from cliport_perception.primitive import Primitive
from cliport_perception.workspace import WorkspaceSpec

SECOND = 1_000_000_000
BEGIN = 1_700_000_000 * SECOND


def make(name: str, /, **values: Any) -> Any:
    return known_types().types[name](**values)


def header(stamp_ns: int, frame: str) -> Any:
    stamp = make("builtin_interfaces/msg/Time", sec=stamp_ns // SECOND, nanosec=stamp_ns % SECOND)
    return make("std_msgs/msg/Header", stamp=stamp, frame_id=frame)


def image(pixels: np.ndarray, encoding: str, stamp_ns: int) -> Any:
    return make(
        "sensor_msgs/msg/Image",
        header=header(stamp_ns, "camera_optical"),
        height=pixels.shape[0],
        width=pixels.shape[1],
        encoding=encoding,
        is_bigendian=0,
        step=pixels.nbytes // pixels.shape[0],
        data=pixels.reshape(-1).view(np.uint8),
    )


@pytest.fixture
def setup() -> CaptureSetup:
    return CaptureSetup(
        workspace=WorkspaceSpec(),
        camera=CameraModel(64, 48, 60.0, 60.0, 31.5, 23.5),
        camera_frame="camera_optical",
        base_frame="panda_link0",
        camera_in_base=Pose.looking_at((1.0, 0.0, 0.8), (0.45, 0.0, 0.0)),
    )


@pytest.fixture
def scene(setup: CaptureSetup) -> Callable[[int], list[RawMessage]]:
    """The messages of the n-th moment; the transforms were sent once, a minute before the first."""

    def messages(moment: int) -> list[RawMessage]:
        now = BEGIN + 10 * moment * SECOND
        rng = np.random.default_rng(moment)
        pose, k = setup.camera_in_base, setup.camera.matrix
        q, t = pose.as_quaternion_xyzw(), pose.translation
        transform = make(
            "geometry_msgs/msg/Transform",
            translation=make("geometry_msgs/msg/Vector3", x=t[0], y=t[1], z=t[2]),
            rotation=make("geometry_msgs/msg/Quaternion", x=q[0], y=q[1], z=q[2], w=q[3]),
        )
        link = make(
            "geometry_msgs/msg/TransformStamped",
            header=header(BEGIN, setup.base_frame),
            child_frame_id=setup.camera_frame,
            transform=transform,
        )
        info = make(
            "sensor_msgs/msg/CameraInfo",
            header=header(now, setup.camera_frame),
            height=setup.camera.height,
            width=setup.camera.width,
            distortion_model="plumb_bob",
            d=np.zeros(5),
            k=k.reshape(-1),
            r=np.eye(3).reshape(-1),
            p=np.hstack([k, np.zeros((3, 1))]).reshape(-1),
            binning_x=0,
            binning_y=0,
            roi=make("sensor_msgs/msg/RegionOfInterest", x_offset=0, y_offset=0, height=0, width=0, do_rectify=False),
        )
        joints = make(
            "sensor_msgs/msg/JointState",
            header=header(now, ""),
            name=["panda_joint1", "panda_finger_joint1"],
            position=np.array([0.1 * moment, 0.04]),
            velocity=np.zeros(0),
            effort=np.zeros(0),
        )
        color = rng.integers(0, 255, (48, 64, 3), dtype=np.uint8)
        depth = np.full((48, 64), 900 + moment, dtype=np.uint16)
        return [
            encode("/camera/aligned_depth_to_color/image_raw", image(depth, "16UC1", now), now + 3_000_000),
            encode("/camera/color/image_raw", image(color, "rgb8", now), now + 1_000_000),
            encode("/camera/color/camera_info", info, now + 2_000_000),
            encode("/joint_states", joints, now),
            encode("/tf_static", make("tf2_msgs/msg/TFMessage", transforms=[link]), BEGIN - 60 * SECOND),
        ]

    return messages


@pytest.fixture
def record() -> StepRecord:
    return StepRecord(
        step=0,
        stamp_ns=BEGIN + 5,
        frame_id="panda_link0",
        instruction="put the red block in the green bowl",
        primitive=Primitive.PICK_PLACE,
        source=Source.CLICKED,
        pick_box=PixelBox(10, 20, 18, 30),
        place_box=None,
        pick_rotation=3,
        place_rotation=35,
        n_rotations=36,
        pick=PlanarPose(0.4, -0.1, 0.5),
        place=PlanarPose(0.5, 0.2, -3.0),
        executed=True,
        outcome=5,
        message="nothing between the fingers",
        grasp_centroid=(0.4, -0.1, 0.02),
        gripper_width=0.031,
    )


@pytest.fixture
def data_set(tmp_path: Path, setup: CaptureSetup) -> DataSet:
    return DataSet.create(tmp_path / "blocks", setup)


@pytest.fixture
def add_episode(
    setup: CaptureSetup, scene: Callable[[int], list[RawMessage]], record: StepRecord
) -> Callable[..., str]:
    """Records an episode of some steps and returns its name."""

    def add(path: Path, n_steps: int = 2, name: str | None = None, success: bool | None = True, **changes: Any) -> str:
        writer = EpisodeWriter.create(path, setup, name)
        for step in range(n_steps):
            writer.add_step(scene(step), replace(record, **changes))
        writer.finish(scene(n_steps), success)
        return writer.name

    return add
