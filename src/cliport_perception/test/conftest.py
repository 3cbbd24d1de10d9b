"""A table with boxes, seen by a tilted camera: depth by exact ray casting."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from importlib.util import find_spec
from typing import NamedTuple

import numpy as np
import pytest

from cliport_core import Pose
from cliport_perception import CameraModel
from cliport_perception.calibration.board import Board
from cliport_perception.calibration.initial_guess import Placement
from cliport_perception.calibration.proposals import candidate_poses, in_view, next_pose
from cliport_perception.calibration.sample import Sample
from cliport_perception.calibration.view import fit_view

# the logic is tested without any build; these need the built messages
NEED_MESSAGES = [
    "test_bad_input.py",
    "test_calibration_compressed.py",
    "test_calibration_lens_nodes.py",
    "test_calibration_moves.py",
    "test_calibration_nodes.py",
    "test_camera_stream.py",
    "test_conversions.py",
    "test_drivers.py",
    "test_node.py",
    "test_verify_nodes.py",
]
collect_ignore = [] if find_spec("cliport_interfaces") else NEED_MESSAGES


class Box(NamedTuple):
    """Axis-aligned, in the base frame [m]; color is RGB."""

    low: tuple[float, float, float]
    high: tuple[float, float, float]
    color: tuple[int, int, int]


TABLE = Box((-1.0, -2.0, -0.05), (3.0, 2.0, 0.0), (120, 110, 100))
CUBE = Box((0.40, -0.10, 0.0), (0.44, -0.06, 0.04), (200, 30, 30))
SLAB = Box((0.50, 0.10, 0.0), (0.60, 0.25, 0.06), (30, 30, 200))


class Scene(NamedTuple):
    """View of one camera: color (H, W, 3), depth (H, W) [m], and where it was."""

    color: np.ndarray
    depth: np.ndarray
    camera: CameraModel
    camera_in_base: Pose


def cast(boxes: list[Box], camera: CameraModel, camera_in_base: Pose) -> Scene:
    rays = camera.rays().astype(np.float64) @ camera_in_base.rotation.T
    origin = camera_in_base.translation
    depth = np.full(rays.shape[:2], np.inf)
    color = np.zeros((*rays.shape[:2], 3), dtype=np.uint8)
    for box in boxes:
        with np.errstate(divide="ignore", invalid="ignore"):
            a, b = (np.array(box.low) - origin) / rays, (np.array(box.high) - origin) / rays
        enter, leave = np.minimum(a, b).max(axis=-1), np.maximum(a, b).min(axis=-1)
        nearer = (enter <= leave) & (enter > 0) & (enter < depth)
        depth[nearer] = enter[nearer]
        color[nearer] = box.color
    depth[~np.isfinite(depth)] = np.nan
    return Scene(color, depth.astype(np.float32), camera, camera_in_base)


@pytest.fixture
def ros() -> Iterator[None]:
    """ROS in a domain of the test's own."""
    import rclpy
    from ros_domain import next_domain

    rclpy.init(domain_id=next_domain())
    yield
    rclpy.try_shutdown()


@pytest.fixture(scope="session")
def camera() -> CameraModel:
    return CameraModel(960, 540, 540.0, 540.0, 480.0, 270.0)


@pytest.fixture(scope="session")
def camera_in_base() -> Pose:
    return Pose.looking_at((1.25, 0.05, 0.95), (0.45, 0.0, 0.0))


@pytest.fixture(scope="session")
def table_scene(camera: CameraModel, camera_in_base: Pose) -> Scene:
    return cast([TABLE], camera, camera_in_base)


@pytest.fixture(scope="session")
def box_scene(camera: CameraModel, camera_in_base: Pose) -> Scene:
    return cast([TABLE, CUBE, SLAB], camera, camera_in_base)


@pytest.fixture(scope="session")
def boxes() -> list[Box]:
    return [CUBE, SLAB]


@pytest.fixture(scope="session")
def cast_scene():
    """`cast(camera, camera_in_base)` of the table with both boxes."""
    return lambda camera, camera_in_base: cast([TABLE, CUBE, SLAB], camera, camera_in_base)


class BoardInHand(NamedTuple):
    """A hidden set-up for calibrations: a camera over the table, and a board that the gripper carries."""

    camera: CameraModel
    board: Board
    placement: Placement
    start: Pose

    def sample(self, rng: np.random.Generator, gripper: Pose, noise_px: float = 0.0, scale: float = 1.0) -> Sample:
        """What would be measured with the gripper at a pose: corners drawn exactly, but for noise."""
        points = np.asarray(self.board.cv_board.getChessboardCorners(), dtype=np.float64)
        pixels = self.camera.project(self.placement.board_in_camera(gripper).apply(scale * points))
        view = fit_view(points, pixels + rng.normal(0.0, noise_px, pixels.shape), self.camera)
        assert view is not None
        return Sample(gripper, view)

    def samples(
        self, count: int, seed: int = 0, noise_px: float = 0.0, arm_m: float = 0.0, scale: float = 1.0
    ) -> list[Sample]:
        """Samples at proposed poses; arm_m: how far the gripper truly is from where it says, per axis."""
        rng = np.random.default_rng(seed)
        told: list[Pose] = []
        found = []
        poses = poses_in_view(self)
        for _ in range(count):
            told.append(next_pose(poses, told, rng))
            true = Pose(told[-1].rotation, told[-1].translation + rng.normal(0.0, arm_m, 3))
            sample = self.sample(rng, true, noise_px, scale)
            found.append(Sample(told[-1], sample.view, len(found)))
        return found


@cache
def poses_in_view(world: BoardInHand) -> list[Pose]:
    """All that may be proposed in a set-up: the same in each test that samples it."""
    return in_view(candidate_poses(world.start), world.placement, world.board, world.camera)


@pytest.fixture(scope="session")
def board_in_hand() -> BoardInHand:
    board = Board()
    camera = CameraModel(960, 540, 540.0, 541.0, 482.0, 268.0, "plumb_bob", (0.08, -0.1, 0.001, -0.0005, 0.0))
    camera_in_base = Pose.looking_at((1.2, 0.15, 0.8), (0.45, 0.0, 0.1))
    held = Pose.from_xyz_rpy((-0.08, -0.06, 0.09), (0.2, -0.1, 0.3))
    facing = Pose.from_xyz_rpy((-0.1, -0.08, 0.75), (0.0, 0.0, 0.2))
    return BoardInHand(camera, board, Placement(camera_in_base, held), camera_in_base @ facing @ held.inverse())
