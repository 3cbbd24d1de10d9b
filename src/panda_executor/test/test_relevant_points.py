from __future__ import annotations

import itertools

import numpy as np

from cliport_core.workspace import WorkspaceSpec
from panda_executor.relevant_points import relevant_points


def test_points_around_the_workspace_are_kept_and_others_are_not() -> None:
    """Each bound is met from either side while the other coordinates stay in the middle."""
    spec = WorkspaceSpec()
    bounds = (
        (spec.x_min - 0.12, spec.x_max + 0.12),
        (spec.y_min - 0.12, spec.y_max + 0.12),
        (spec.z_min - 0.02, spec.z_max),
    )
    middle = [(low + high) / 2 for low, high in bounds]
    inside, outside = [], []
    for axis, (low, high) in enumerate(bounds):
        for bound, inwards in ((low, 1.0), (high, -1.0)):
            for chosen, shift in ((inside, 0.001), (outside, -0.001)):
                point = list(middle)
                point[axis] = bound + inwards * shift
                chosen.append(point)
    cloud = np.array([*inside, *outside, [np.nan] * 3], dtype=np.float32)
    np.testing.assert_array_equal(relevant_points(cloud, spec), np.array(inside, dtype=np.float32))


def test_corners_are_kept() -> None:
    spec = WorkspaceSpec()
    corners = itertools.product((spec.x_min, spec.x_max), (spec.y_min, spec.y_max), (spec.z_min, spec.z_max - 1e-4))
    cloud = np.array(list(corners), dtype=np.float32)
    assert len(relevant_points(cloud, spec)) == 8
