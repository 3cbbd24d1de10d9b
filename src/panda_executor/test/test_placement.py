"""The hand goes as low as what stands at the place lets it."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from synthetic_clouds import Bowl, Cube, cloud_of, container_points, cube_points, ring_points, seen_cloud

from cliport_core.pose import PlanarPose
from cliport_core.workspace import WorkspaceSpec
from panda_executor.grasp import Grasp, plan_grasps
from panda_executor.placement import PlacementConfig, plan_placement
from panda_model import load_preset

HAND = load_preset().hand

CONFIG = PlacementConfig()


@pytest.fixture(scope="module")
def grasp(workspace: WorkspaceSpec) -> Grasp:
    return plan_grasps(cloud_of([Cube(0.45, 0.1)]), PlanarPose(0.45, 0.1, 0.0), workspace)[0]


@pytest.mark.parametrize("yaw", [0.0, 0.7, 2.0])
def test_on_the_bare_table(grasp: Grasp, workspace: WorkspaceSpec, yaw: float) -> None:
    placement = plan_placement(cloud_of([]), PlanarPose(0.5, -0.2, yaw), yaw, grasp, workspace)
    assert (placement.x, placement.y, placement.yaw) == (0.5, -0.2, yaw)
    assert placement.tcp_z - grasp.tcp_z == pytest.approx(CONFIG.release_gap, abs=0.001)
    assert placement.support_z == pytest.approx(0.0, abs=1e-6)
    assert grasp.width < placement.opening <= HAND.opening


def test_where_nothing_was_seen_it_is_the_table(grasp: Grasp, workspace: WorkspaceSpec) -> None:
    nothing = np.full((9, 3), np.nan, np.float32)
    placement = plan_placement(nothing, PlanarPose(0.5, 0.0, 0.0), 0.0, grasp, workspace, table_z=-0.01)
    assert placement.support_z == -0.01


def test_a_thing_larger_than_what_is_looked_at_is_still_put_down(grasp: Grasp, workspace: WorkspaceSpec) -> None:
    steps = np.arange(-0.2, 0.2, grasp.cell)
    plate = replace(grasp, footprint=np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2))
    placement = plan_placement(cloud_of([]), PlanarPose(0.5, -0.2, 0.0), 0.0, plate, workspace)
    assert placement.support_z == pytest.approx(0.0, abs=1e-6)


def test_on_top_of_another_cube(grasp: Grasp, workspace: WorkspaceSpec) -> None:
    placement = plan_placement(cloud_of([Cube(0.5, -0.2)]), PlanarPose(0.5, -0.2, 0.0), 0.0, grasp, workspace)
    assert placement.support_z == pytest.approx(0.04, abs=0.001)
    assert placement.tcp_z == pytest.approx(0.04 + grasp.tcp_z + CONFIG.release_gap, abs=0.002)


@pytest.mark.parametrize("along", [0.015, 0.02, -0.02])
@pytest.mark.parametrize("yaw", [0.0, 0.8, math.pi / 2])
def test_the_fingers_stay_above_a_rim(grasp: Grasp, workspace: WorkspaceSpec, along: float, yaw: float) -> None:
    bowl = Bowl(0.5, -0.2)
    place = PlanarPose(bowl.x + along * math.cos(yaw), bowl.y + along * math.sin(yaw), yaw)
    placement = plan_placement(cloud_of([], [bowl]), place, yaw, grasp, workspace)
    assert placement.tcp_z - HAND.fingertip_below_tcp >= bowl.height + CONFIG.finger_clearance - 1e-6


def test_the_object_falls_a_bowls_depth_at_most(grasp: Grasp, workspace: WorkspaceSpec) -> None:
    bowl = Bowl(0.5, -0.2)
    placement = plan_placement(cloud_of([], [bowl]), PlanarPose(0.5, -0.2, 0.3), 0.3, grasp, workspace)
    underside = placement.tcp_z - (grasp.tcp_z - grasp.support_z)
    assert placement.support_z == pytest.approx(bowl.floor, abs=0.002)
    assert placement.support_z < underside < bowl.height + 0.005


def held_box(size: tuple[float, float, float], yaw: float, workspace: WorkspaceSpec) -> Grasp:
    """A box at (0.45, 0.15) between fingers that close at `yaw`."""
    cloud = seen_cloud(cube_points(Cube(0.45, 0.15, size=size)))
    return plan_grasps(cloud, PlanarPose(0.45, 0.15, yaw), workspace)[0]


@pytest.mark.parametrize("yaw", [0.0, 0.5, -1.2])
def test_a_flat_thing_is_let_go_on_a_containers_floor(workspace: WorkspaceSpec, yaw: float) -> None:
    grasp = held_box((0.04, 0.06, 0.02), 0.0, workspace)
    cloud = seen_cloud(container_points(0.45, -0.2, 0.14, 0.12, yaw))
    placement = plan_placement(cloud, PlanarPose(0.45, -0.2, yaw), yaw, grasp, workspace)
    assert placement.support_z < 0.006
    assert placement.fall == 0.0
    assert grasp.width + 0.01 < placement.opening


@pytest.mark.parametrize("yaw", [0.0, 0.5, -1.2])
def test_between_walls_without_room_the_fingers_stay_above_them(workspace: WorkspaceSpec, yaw: float) -> None:
    grasp = held_box((0.07, 0.1, 0.05), 0.0, workspace)
    cloud = seen_cloud(container_points(0.45, -0.2, 0.092, 0.122, yaw))  # 10 mm to each wall
    place = PlanarPose(0.45, -0.2, yaw)
    placement = plan_placement(cloud, place, yaw, grasp, workspace)
    tips = placement.tcp_z - HAND.fingertip_below_tcp
    assert 0.05 + 0.002 < tips < 0.05 + 0.01
    assert placement.fall > 0.01
    higher = grasp.raised(placement.fall)
    again = plan_placement(cloud, place, yaw, higher, workspace)
    assert again.tcp_z == pytest.approx(placement.tcp_z)
    assert again.fall == pytest.approx(placement.fall - (higher.tcp_z - grasp.tcp_z))
    assert again.fall < 0.012  # held by its uppermost part, it falls less far


def test_fingers_that_open_less_go_lower(workspace: WorkspaceSpec) -> None:
    grasp = held_box((0.04, 0.04, 0.02), 0.0, workspace)
    place = PlanarPose(0.45, -0.2, 0.0)
    neighbours = [Cube(0.45 + side * (0.02 + 0.029 + 0.015), -0.2, size=(0.03, 0.03, 0.02)) for side in (-1, 1)]
    placement = plan_placement(seen_cloud(*map(cube_points, neighbours)), place, 0.0, grasp, workspace)
    assert placement.fall == 0.0
    assert placement.opening < grasp.width + CONFIG.margins[0]


def test_a_neighbour_in_the_row_lifts_nothing(workspace: WorkspaceSpec) -> None:
    grasp = held_box((0.04, 0.04, 0.04), math.pi / 2, workspace)
    row = [Cube(0.45 + dx, -0.2) for dx in (-0.05, 0.05)]  # 10 mm beside; the jaws close across the row
    place = PlanarPose(0.45, -0.2, math.pi / 2)
    placement = plan_placement(seen_cloud(*map(cube_points, row)), place, math.pi / 2, grasp, workspace)
    assert placement.support_z < 0.004
    assert placement.fall == 0.0


def test_a_ring_goes_over_a_peg(workspace: WorkspaceSpec) -> None:
    cloud = seen_cloud(ring_points(0.45, 0.15, 0.0, 0.03))
    grasp = plan_grasps(cloud, PlanarPose(0.45, 0.15, 0.0), workspace)[0]
    peg = ring_points(0.45, -0.2, 0.0, 0.005, 0.0, 0.03)
    placement = plan_placement(seen_cloud(peg), PlanarPose(0.45, -0.2, 0.4), 0.4, grasp, workspace)
    assert placement.support_z < 0.004  # not on the peg's top
    held = grasp.held()
    distance = np.hypot(*held.surface(HAND.palm_above_tcp)[:, :2].T)
    assert distance.min() > 0.01  # and the checks leave the hole free
    assert distance.max() == pytest.approx(0.028, abs=0.003)


@pytest.mark.parametrize(("held_at", "placed_at"), [(0.6, -0.2), (-0.5, 0.4)])
def test_a_long_thing_lies_on_what_is_under_its_end_once_it_is_turned(
    workspace: WorkspaceSpec, held_at: float, placed_at: float
) -> None:
    cube = Cube(0.45, 0.15, held_at, size=(0.03, 0.10, 0.04))
    grasp = plan_grasps(seen_cloud(cube_points(cube)), PlanarPose(0.45, 0.15, held_at), workspace)[0]
    place = PlanarPose(0.45, -0.2, placed_at)
    end = Cube(
        place.x - 0.038 * math.sin(placed_at), place.y + 0.038 * math.cos(placed_at), placed_at, size=(0.02, 0.02, 0.03)
    )
    under = plan_placement(seen_cloud(cube_points(end)), place, placed_at, grasp, workspace)
    assert under.support_z == pytest.approx(0.03, abs=0.004)
    across = PlanarPose(0.45, -0.2, placed_at + math.pi / 2)
    assert plan_placement(seen_cloud(cube_points(end)), across, across.yaw, grasp, workspace).support_z < 0.004
