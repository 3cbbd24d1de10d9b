"""The table's height as it is seen, against what is configured."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from synthetic_clouds import Cube, cube_points, seen_cloud

from cliport_core.outcome import Refusal
from cliport_core.workspace import WorkspaceSpec
from panda_executor.errors import RequestError
from panda_executor.request_check import check_table
from panda_executor.table_plane import TableConfig, measure_table

THINGS = [cube_points(Cube(0.45, 0.1, 0.3)), cube_points(Cube(0.4, -0.2, size=(0.15, 0.2, 0.018)))]


def cloud_at(height: float, tilt: float = 0.0) -> np.ndarray:
    """A table with things on it at `height` [m], tilted along y."""
    cloud = seen_cloud(*THINGS, noise=0.0015)
    cloud[:, 2] += height + tilt * cloud[:, 1]
    return cloud


@pytest.mark.parametrize("height", [-0.02, -0.004, 0.0, 0.004, 0.012, 0.02])
def test_the_height_is_measured(workspace: WorkspaceSpec, height: float) -> None:
    plane = measure_table(cloud_at(height), workspace, 0.0)
    assert plane is not None
    assert plane.height == pytest.approx(height, abs=0.001)
    assert abs(plane.slope_x) < 0.003 and abs(plane.slope_y) < 0.003


def test_the_height_of_a_tilted_table_is_that_in_the_workspaces_middle(workspace: WorkspaceSpec) -> None:
    cloud = seen_cloud(*THINGS, noise=0.0015)
    cloud[:, 2] += 0.01 * (cloud[:, 0] - 0.45) + 0.005 * cloud[:, 1]
    plane = measure_table(cloud, workspace, 0.0)
    assert plane is not None
    assert (plane.height, plane.slope_x, plane.slope_y) == pytest.approx((0.0, 0.01, 0.005), abs=1.5e-3)
    assert plane.height_at(0.65, 0.4) == pytest.approx(0.004, abs=1e-3)


@pytest.mark.parametrize("height", [-0.02, -0.004, 0.004, 0.012, 0.02])
def test_a_table_at_another_height_is_refused(workspace: WorkspaceSpec, height: float) -> None:
    """At 4 to 20 mm a sweep's fingertips would have been 1 to 17 mm inside it."""
    side = "above" if height > 0 else "below"
    with pytest.raises(RequestError, match=f"mm {side} its configured height of 0 m .*set table_z") as caught:
        check_table(cloud_at(height), workspace, 0.0, TableConfig())
    assert caught.value.refusal is Refusal.TABLE_HEIGHT
    assert caught.value.limit == 0.003 and caught.value.value == pytest.approx(height, abs=0.003)
    check_table(cloud_at(height), workspace, height, TableConfig())


def test_a_tilted_table_is_refused(workspace: WorkspaceSpec) -> None:
    with pytest.raises(RequestError, match="its configured height"):
        check_table(cloud_at(0.0, tilt=0.02), workspace, 0.0, TableConfig())


def test_a_table_where_it_should_be_passes(workspace: WorkspaceSpec) -> None:
    check_table(cloud_at(0.0), workspace, 0.0, TableConfig())
    check_table(cloud_at(0.0015), workspace, 0.0, TableConfig())


def test_a_table_that_is_not_seen_is_not_judged(workspace: WorkspaceSpec) -> None:
    cloud = cloud_at(0.02)
    high = cloud[cloud[:, 2] > 0.035]
    assert measure_table(high, workspace, 0.0) is None
    check_table(high, workspace, 0.0, replace(TableConfig(), tolerance=1e-6))
