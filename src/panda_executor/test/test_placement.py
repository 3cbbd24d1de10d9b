"""The hand goes as low as what stands at the place lets it."""

from __future__ import annotations

import math

import numpy as np
import pytest
from synthetic_clouds import Bowl, Cube, cloud_of

from cliport_perception.pose import PlanarPose
from cliport_perception.workspace import WorkspaceSpec
from panda_executor.grasp import Grasp, plan_grasps
from panda_executor.hand_geometry import FINGERTIP_BELOW_TCP, MAX_OPENING
from panda_executor.placement import PlacementConfig, plan_placement

CONFIG = PlacementConfig()


@pytest.fixture(scope="module")
def grasp(workspace: WorkspaceSpec) -> Grasp:
    return plan_grasps(cloud_of([Cube(0.45, 0.1)]), PlanarPose(0.45, 0.1, 0.0), workspace)[0]


@pytest.mark.parametrize("yaw", [0.0, 0.7, 2.0])
def test_on_the_bare_table(grasp: Grasp, workspace: WorkspaceSpec, yaw: float) -> None:
    placement = plan_placement(cloud_of([]), PlanarPose(0.5, -0.2, yaw), yaw, grasp, workspace)
    assert (placement.x, placement.y, placement.yaw) == (0.5, -0.2, yaw)
    assert placement.tcp_z - grasp.tcp_z == pytest.approx(CONFIG.drop, abs=0.001)
    assert placement.support_z == pytest.approx(0.0, abs=1e-6)
    assert grasp.width < placement.opening <= MAX_OPENING


def test_where_nothing_was_seen_it_is_the_table(grasp: Grasp, workspace: WorkspaceSpec) -> None:
    nothing = np.full((9, 3), np.nan, np.float32)
    placement = plan_placement(nothing, PlanarPose(0.5, 0.0, 0.0), 0.0, grasp, workspace, table_z=-0.01)
    assert placement.support_z == -0.01


def test_on_top_of_another_cube(grasp: Grasp, workspace: WorkspaceSpec) -> None:
    placement = plan_placement(cloud_of([Cube(0.5, -0.2)]), PlanarPose(0.5, -0.2, 0.0), 0.0, grasp, workspace)
    assert placement.support_z == pytest.approx(0.04, abs=0.001)
    assert placement.tcp_z == pytest.approx(0.04 + grasp.tcp_z + CONFIG.drop, abs=0.002)


@pytest.mark.parametrize("along", [0.015, 0.02, -0.02])
@pytest.mark.parametrize("yaw", [0.0, 0.8, math.pi / 2])
def test_the_fingers_stay_above_a_rim(grasp: Grasp, workspace: WorkspaceSpec, along: float, yaw: float) -> None:
    bowl = Bowl(0.5, -0.2)
    place = PlanarPose(bowl.x + along * math.cos(yaw), bowl.y + along * math.sin(yaw), yaw)
    placement = plan_placement(cloud_of([], [bowl]), place, yaw, grasp, workspace)
    assert placement.tcp_z - FINGERTIP_BELOW_TCP >= bowl.height + CONFIG.finger_clearance - 1e-6


def test_the_object_falls_a_bowls_depth_at_most(grasp: Grasp, workspace: WorkspaceSpec) -> None:
    bowl = Bowl(0.5, -0.2)
    placement = plan_placement(cloud_of([], [bowl]), PlanarPose(0.5, -0.2, 0.3), 0.3, grasp, workspace)
    underside = placement.tcp_z - (grasp.tcp_z - grasp.support_z)
    assert placement.support_z == pytest.approx(bowl.floor, abs=0.002)
    assert placement.support_z < underside < bowl.height + 0.005
