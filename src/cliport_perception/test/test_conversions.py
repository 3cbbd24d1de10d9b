from __future__ import annotations

import statistics
import time

import numpy as np
import pytest
from rclpy.serialization import deserialize_message, serialize_message

from cliport_perception import (
    CameraModel,
    ImageError,
    Pose,
    WorkspaceError,
    WorkspaceSpec,
    heightmap_from_rgbd,
)
from cliport_perception import conversions as c
from cliport_perception.camera_health import HealthReport, Level
from cliport_perception.clouds import CloudBuilder


def over_the_wire(message):
    return deserialize_message(serialize_message(message), type(message))


@pytest.mark.parametrize("stamp_ns", [0, 1, 999_999_999, 1_000_000_000, 1_722_222_222_123_456_789])
def test_stamps(stamp_ns: int) -> None:
    assert c.stamp_from_msg(c.stamp_to_msg(stamp_ns)) == stamp_ns


@pytest.mark.parametrize("seed", range(5))
def test_poses_and_transforms(seed: int) -> None:
    rng = np.random.default_rng(seed)
    pose = Pose.from_quaternion_xyzw(rng.normal(size=4), rng.normal(size=3))
    assert c.pose_from_msg(c.pose_to_msg(pose)).is_close(pose)
    assert c.pose_from_transform_msg(c.pose_to_transform_msg(pose)).is_close(pose)


def test_workspace() -> None:
    spec = WorkspaceSpec(x_min=0.3, x_max=0.5, n_rotations=12)
    assert c.workspace_from_msg(over_the_wire(c.workspace_to_msg(spec))) == spec
    with pytest.raises(WorkspaceError):
        c.workspace_from_msg(c.WorkspaceSpecMsg())


def test_camera_raw_and_rectified() -> None:
    camera = CameraModel(960, 540, 540.0, 541.0, 479.0, 268.0, "plumb_bob", (0.1, -0.2, 0.001, 0.002, 0.03))
    message = over_the_wire(c.camera_to_msg(camera))
    assert c.camera_from_msg(message) == camera
    rectified = c.camera_from_msg(message, rectified=True)
    assert not rectified.is_distorted
    assert (rectified.fx, rectified.cy) == (540.0, 268.0)


def test_images() -> None:
    rng = np.random.default_rng(0)
    color = rng.integers(0, 256, (6, 8, 3), dtype=np.uint8)
    np.testing.assert_array_equal(c.color_from_msg(over_the_wire(c.image_to_msg(color, "rgb8"))), color)
    depth = rng.uniform(0.5, 2.0, (6, 8)).astype(np.float32)
    np.testing.assert_array_equal(c.depth_from_msg(over_the_wire(c.image_to_msg(depth, "32FC1"))), depth)
    message = c.image_to_msg(depth.astype(">f4")[:, ::2], "32FC1")
    np.testing.assert_array_equal(c.depth_from_msg(message), depth[:, ::2])


def test_heightmap(box_scene) -> None:
    heightmap = heightmap_from_rgbd(*box_scene, WorkspaceSpec(), 1_234_567_890_123)
    message = over_the_wire(c.heightmap_to_msg(heightmap, "panda_link0"))
    assert message.header.frame_id == message.height.header.frame_id == "panda_link0"
    back = c.heightmap_from_msg(message)
    assert (back.workspace, back.stamp_ns) == (heightmap.workspace, heightmap.stamp_ns)
    for name in ("color", "height", "valid"):
        np.testing.assert_array_equal(getattr(back, name), getattr(heightmap, name))
    message.height.encoding = "16UC1"
    with pytest.raises(ImageError, match="heightmap height must be"):
        c.heightmap_from_msg(message)


def test_cloud_and_its_cost(box_scene) -> None:
    builder = CloudBuilder(box_scene.camera, box_scene.camera_in_base)
    seconds = []
    for _ in range(7):
        start = time.thread_time()
        data = builder.build(box_scene.color, box_scene.depth)
        message = c.cloud_to_msg(data, 540, 960, "panda_link0", 5)
        seconds.append(time.thread_time() - start)
    assert statistics.median(seconds) < 0.04  # CPU time: the machine may be busy
    assert (message.point_step, message.row_step, message.is_dense) == (32, 32 * 960, False)
    assert [(f.name, f.offset) for f in message.fields] == [("x", 0), ("y", 4), ("z", 8), ("rgb", 16)]
    back = c.cloud_points_from_msg(over_the_wire(message))
    exact = box_scene.camera_in_base.apply(box_scene.camera.rays() * box_scene.depth[..., None])
    np.testing.assert_allclose(back, exact.reshape(-1, 3), atol=1e-4)
    message.point_step = 16
    with pytest.raises(ImageError, match="xyzrgb"):
        c.cloud_points_from_msg(message)


def test_diagnostics() -> None:
    report = HealthReport(Level.STALE, "newest camera frame is old", {"age_s": "2.0"})
    message = over_the_wire(c.diagnostics_to_msg("camera", report, 7))
    status = message.status[0]
    assert (status.level, status.name, status.message) == (b"\x03", "camera", "newest camera frame is old")
    assert [(v.key, v.value) for v in status.values] == [("age_s", "2.0")]
