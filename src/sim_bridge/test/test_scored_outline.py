"""The points on the outline of the box by which a thing is scored."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from cliport_core.pose import Pose
from sim_bridge.task_mechanics.placing import _box


@pytest.mark.parametrize(("yaw", "width", "depth"), [(0.0, 0.3, 0.6), (math.pi / 2, 0.6, 0.3)])
def test_an_outline_has_the_corners_and_two_points_on_each_side(yaw: float, width: float, depth: float) -> None:
    vertices = np.array([[0.15, -0.3, 0.0], [-0.15, 0.3, 0.1], [0.0, 0.0, 0.05]])
    thing: Any = SimpleNamespace(mesh=SimpleNamespace(vertices=vertices))
    world: Any = SimpleNamespace(object_pose=lambda thing: Pose.from_xyz_rpy((9.0, 9.0, 9.0), (0.0, 0.0, yaw)))
    points = _box(world, thing)
    assert points.shape == (12, 2)
    shares = np.array([-0.5, -0.5 + 0.33, -0.5 + 0.67, 0.5])
    near = np.abs(points[:, :, None] / np.array([[width], [depth]]) - np.stack([shares, shares])).min(axis=2)
    mirrored = np.abs(points[:, :, None] / np.array([[width], [depth]]) + np.stack([shares, shares])).min(axis=2)
    assert np.minimum(near, mirrored).max() < 1e-6
    on_side = np.isclose(np.abs(points), [width / 2, depth / 2])
    assert on_side.any(axis=1).all() and on_side.all(axis=1).sum() == 4
    assert len(np.unique(points.round(6), axis=0)) == 12
