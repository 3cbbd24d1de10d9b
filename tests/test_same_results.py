"""Short cuts on a frame's way change no result: the plain way and the short one, bit by bit."""

from collections.abc import Iterator

import numpy as np
import pytest
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import Image, PointCloud2

from cliport_core import PlanarPose, Pose, WorkspaceSpec
from cliport_core.images import decode_color, decode_depth
from cliport_core.messages import (
    color_from_msg,
    depth_from_msg,
    image_to_msg,
    planar_pose_from_msg,
    planar_pose_to_msg,
    pose_from_msg,
)
from cliport_core.raw_image import image_of_raw
from cliport_perception.clouds import CloudBuilder, CloudRegion
from cliport_perception.conversions import cloud_points_from_msg, cloud_to_msg
from cliport_perception.heightmap_builder import HeightmapBuilder
from cliport_policy import load_policy
from panda_executor.grasp import plan_grasps
from panda_executor.obstacle_grid import ObstacleGrid
from panda_executor.relevant_points import relevant_points
from sim_bridge.rendering.camera import RgbdFrame, SimCamera
from sim_bridge.scene import reset_scene
from sim_bridge.task_mechanics.task import Task
from sim_bridge.world import SimConfig, SimWorld

TASK = "put-blocks-in-bowls-seen-colors"


@pytest.fixture(scope="module")
def camera() -> SimCamera:
    return SimCamera()


@pytest.fixture(scope="module")
def scene(camera: SimCamera) -> Iterator[tuple[SimWorld, Task, RgbdFrame]]:
    world = SimWorld(SimConfig())
    task = reset_scene(world, TASK, "val", 0)
    yield world, task, camera.capture(world, np.random.default_rng(0))
    world.close()


def _plain_points(camera: SimCamera, frame: RgbdFrame) -> np.ndarray:
    """Every pixel's point (H * W, 3) [m], NaN where nothing was seen: the cloud as a whole."""
    pose = camera.camera_in_base
    rays = np.moveaxis(camera.intrinsics.rays() @ pose.rotation.T.astype(np.float32), -1, 0)
    start = pose.translation.astype(np.float32)
    planes = [frame.depth * np.ascontiguousarray(rays[axis]) + start[axis] for axis in range(3)]
    return np.stack(planes, axis=-1).reshape(-1, 3)


def test_the_executor_sees_the_same_in_the_cropped_cloud(
    camera: SimCamera, scene: tuple[SimWorld, Task, RgbdFrame]
) -> None:
    world, task, frame = scene
    workspace = world.config.workspace
    builder = CloudBuilder(camera.intrinsics, camera.camera_in_base, CloudRegion.around(workspace))
    message = cloud_to_msg(builder.build(frame.color, frame.depth), "panda_link0", 1)
    cropped = cloud_points_from_msg(deserialize_message(serialize_message(message), PointCloud2))
    whole = _plain_points(camera, frame)
    assert len(cropped) < 0.7 * len(whole)
    near = relevant_points(cropped, workspace)
    assert near.tobytes() == relevant_points(whole, workspace).tobytes()
    grids = [ObstacleGrid.from_cloud(cloud, workspace, 0.006) for cloud in (cropped, whole)]
    assert grids[0].heights.tobytes() == grids[1].heights.tobytes() and (grids[0].heights > 0).any()
    action = task.expert_action()
    first, second = (plan_grasps(cloud, action.pick, workspace)[0] for cloud in (cropped, whole))
    assert (first.tcp_z, first.yaw, first.opening) == (second.tcp_z, second.yaw, second.opening)
    assert first.centroid.tobytes() == second.centroid.tobytes()
    assert first.footprint.tobytes() == second.footprint.tobytes()


def test_heightmap_and_action_do_not_depend_on_how_the_images_were_read(
    camera: SimCamera, scene: tuple[SimWorld, Task, RgbdFrame]
) -> None:
    _, task, frame = scene
    raws = [serialize_message(image_to_msg(frame.color, "rgb8")), serialize_message(image_to_msg(frame.depth, "32FC1"))]
    in_place = decode_color(image_of_raw(raws[0])), decode_depth(image_of_raw(raws[1]))
    messages = [deserialize_message(raw, Image) for raw in raws]
    builder = HeightmapBuilder(camera.intrinsics, camera.camera_in_base, WorkspaceSpec())
    first, second = builder.build(*in_place), builder.build(color_from_msg(messages[0]), depth_from_msg(messages[1]))
    assert first.height.tobytes() == second.height.tobytes() and first.color.tobytes() == second.color.tobytes()
    sentence = task.instruction
    checked, plain = load_policy("default"), load_policy("default")
    checked.check_instruction(sentence)  # as the server does before it acts
    assert checked.infer(first, sentence) == plain.infer(second, sentence)


@pytest.mark.parametrize("unknown", [0.0, -0.5, np.inf, -np.inf, 200.0])
def test_what_is_not_known_may_be_anything_outside_the_workspace(
    camera: SimCamera, scene: tuple[SimWorld, Task, RgbdFrame], unknown: float
) -> None:
    _, _, frame = scene
    builder = HeightmapBuilder(camera.intrinsics, camera.camera_in_base, WorkspaceSpec())
    holes = np.random.default_rng(0).random(frame.depth.shape) < 0.2
    masked, filled = (np.where(holes, np.float32(value), frame.depth) for value in (np.nan, unknown))
    first, second = builder.build(frame.color, masked), builder.build(frame.color, filled)
    assert first.height.tobytes() == second.height.tobytes() and first.color.tobytes() == second.color.tobytes()


def test_yaws_are_read_from_messages_as_over_matrices() -> None:
    rng = np.random.default_rng(0)
    for x, y, yaw in rng.uniform(-7.0, 7.0, (2000, 3)):
        message = planar_pose_to_msg(PlanarPose(x, y, yaw))
        assert planar_pose_from_msg(message) == PlanarPose.from_pose(pose_from_msg(message))
        assert abs(np.remainder(planar_pose_from_msg(message).yaw - yaw + np.pi, 2 * np.pi) - np.pi) < 1e-14
        q = rng.normal(size=4)
        turned = Pose.from_quaternion_xyzw(q, (x, y, 0.3))
        assert PlanarPose.from_quaternion_xyzw(q, x, y) == PlanarPose.from_pose(turned)
