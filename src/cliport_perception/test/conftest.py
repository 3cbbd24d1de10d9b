"""A table with boxes, seen by a tilted camera: depth by exact ray casting."""

from __future__ import annotations

from importlib.util import find_spec
from typing import NamedTuple

import numpy as np
import pytest

from cliport_core import Pose
from cliport_perception import CameraModel

# the logic is tested without any build; these two need the built messages
collect_ignore = [] if find_spec("cliport_interfaces") else ["test_conversions.py", "test_node.py"]


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
