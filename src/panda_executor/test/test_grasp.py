"""Grasps from clouds that show one side of things."""

from __future__ import annotations

import math

import numpy as np
import pytest
from synthetic_clouds import Cube, cloud_of, table_points

from cliport_core.pose import PlanarPose
from cliport_core.workspace import WorkspaceSpec
from panda_executor import grasp
from panda_executor.errors import GraspError
from panda_executor.grasp import Grasp, plan_grasps
from panda_model import load_preset

HAND = load_preset().hand


def first(cloud: np.ndarray, x: float, y: float, yaw: float, workspace: WorkspaceSpec) -> Grasp:
    return plan_grasps(cloud, PlanarPose(x, y, yaw), workspace)[0]


def off(grasp: Grasp, cube: Cube) -> float:
    return float(np.hypot(grasp.centroid[0] - cube.x, grasp.centroid[1] - cube.y))


@pytest.mark.parametrize("noise", [0.0, 0.0015])
@pytest.mark.parametrize("yaw", np.linspace(0.0, math.pi / 2, 7))
@pytest.mark.parametrize(("x", "y"), [(0.3, -0.3), (0.45, 0.0), (0.6, 0.35)])
def test_a_turned_cube_seen_from_one_side(
    workspace: WorkspaceSpec, x: float, y: float, yaw: float, noise: float
) -> None:
    cube = Cube(x, y, yaw)
    grasp = first(cloud_of([cube], noise=noise, seed=1), x, y, yaw, workspace)
    assert off(grasp, cube) < 0.003
    assert 0.03 < grasp.centroid[2] < 0.043
    assert grasp.width == pytest.approx(0.04, abs=0.009)
    assert grasp.length == pytest.approx(0.04, abs=0.009)
    assert grasp.yaw == yaw
    assert grasp.support_z == 0.0
    assert grasp.width < grasp.opening <= HAND.opening
    assert HAND.fingertip_below_tcp < grasp.tcp_z < 0.03


@pytest.mark.parametrize(("dx", "dy"), [(0.015, 0.0), (-0.015, 0.01), (0.0, -0.018)])
def test_a_pick_beside_the_middle_finds_the_middle(workspace: WorkspaceSpec, dx: float, dy: float) -> None:
    cube = Cube(0.45, 0.1, 0.4)
    assert off(first(cloud_of([cube]), 0.45 + dx, 0.1 + dy, 0.4, workspace), cube) < 0.003


def test_neighbours_in_the_crop_do_not_pull(workspace: WorkspaceSpec) -> None:
    cube = Cube(0.45, 0.0)
    others = [Cube(0.45, 0.06), Cube(0.45, -0.065, size=(0.04, 0.04, 0.06))]
    grasps = plan_grasps(cloud_of([cube, *others], noise=0.001), PlanarPose(0.45, 0.0, 0.0), workspace)
    assert off(grasps[0], cube) < 0.003
    assert grasps[0].length < 0.05


def test_a_neighbour_beside_it_turns_the_jaws(workspace: WorkspaceSpec) -> None:
    cloud = cloud_of([Cube(0.45, 0.0), Cube(0.45, 0.05), Cube(0.45, -0.05)])
    (grasp,) = plan_grasps(cloud, PlanarPose(0.45, 0.0, math.pi / 2), workspace)
    assert abs(math.sin(grasp.yaw)) < 1e-6  # they close along x, where there is room


def test_a_tall_object_is_held_near_its_top(workspace: WorkspaceSpec) -> None:
    tall = first(cloud_of([Cube(0.45, 0.0, size=(0.03, 0.03, 0.12))]), 0.45, 0.0, 0.0, workspace)
    assert tall.top_z == pytest.approx(0.12, abs=0.002)
    assert 0.12 - 0.04 < tall.tcp_z < 0.12 - 0.01


@pytest.mark.parametrize("side", [0.03, 0.05])
def test_the_sides_of_a_tall_object_do_not_pull_its_grasp_down(workspace: WorkspaceSpec, side: float) -> None:
    """A tilted camera sees them, in the same cells as the edge of the top."""
    tall = first(cloud_of([Cube(0.45, 0.0, size=(side, side, 0.12))]), 0.45, 0.0, 0.0, workspace)
    assert 0.118 < tall.centroid[2] <= 0.12


def test_an_object_on_another_keeps_its_support(workspace: WorkspaceSpec) -> None:
    # a cube on a large low slab: the slab is what it stands on
    cloud = cloud_of([Cube(0.45, 0.0, size=(0.2, 0.2, 0.02)), Cube(0.45, 0.0, z=0.02)])
    grasp = first(cloud, 0.45, 0.0, 0.0, workspace)
    assert grasp.support_z == pytest.approx(0.02, abs=0.002)
    assert grasp.tcp_z - HAND.fingertip_below_tcp > 0.02


def test_missing_points_change_nothing(workspace: WorkspaceSpec) -> None:
    cube = Cube(0.45, 0.1, 0.3)
    cloud = cloud_of([cube])
    shuffled = np.random.default_rng(0).permutation(np.concatenate([cloud, np.full((5000, 3), np.nan, np.float32)]))
    a, b = (first(c, 0.45, 0.1, 0.3, workspace) for c in (cloud, shuffled))
    np.testing.assert_allclose(a.centroid, b.centroid, atol=1e-6)
    assert a.opening == b.opening


def test_covers_the_object_and_nothing_else(workspace: WorkspaceSpec) -> None:
    cube, other = Cube(0.45, 0.0, 0.3), Cube(0.45, 0.07)
    grasp = first(cloud_of([cube, other]), 0.45, 0.0, 0.3, workspace)
    assert grasp.covers(raised(cube), 0.008).all()
    assert not grasp.covers(raised(other), 0.008).any()
    assert not grasp.covers(table_points().astype(np.float32), 0.008).any()
    assert not grasp.covers(np.full((3, 3), np.nan, np.float32), 0.008).any()


def raised(cube: Cube) -> np.ndarray:
    cloud = cloud_of([cube])
    return cloud[cloud[:, 2] > 0.005]


@pytest.mark.parametrize(
    ("cloud", "words"),
    [
        (cloud_of([Cube(0.6, 0.3)]), r"nothing rises more than 8 mm above the table at the pick \(0\.450, 0\.000\) m"),
        (cloud_of([Cube(0.45, 0.045)]), "nothing rises"),
        (np.full((50, 3), np.nan, np.float32), "no depth was seen around the pick"),
        (np.zeros((0, 3), np.float32), "no depth was seen"),
        (cloud_of([Cube(0.45, 0.0, size=(0.1, 0.1, 0.04))]), r"(9\d|10\d) mm wide between the fingers, 75 mm is the"),
        (
            cloud_of([Cube(0.45 + dx, dy) for dx, dy in ((0, 0), (0.05, 0), (-0.05, 0), (0, 0.05), (0, -0.05))]),
            "no room for the fingers beside the object",
        ),
    ],
    ids=["nothing there", "too far away", "all NaN", "empty", "too wide", "no room"],
)  # fmt: skip
def test_no_grasp_is_one_line(workspace: WorkspaceSpec, cloud: np.ndarray, words: str) -> None:
    with pytest.raises(GraspError, match=words) as caught:
        plan_grasps(cloud, PlanarPose(0.45, 0.0, 0.0), workspace)
    assert "\n" not in str(caught.value)


def test_of_two_reasons_the_one_of_the_thing_at_the_pick_is_given(
    workspace: WorkspaceSpec, monkeypatch: pytest.MonkeyPatch
) -> None:
    reasons = iter(("too wide by itself", "too wide with what touches it"))
    monkeypatch.setattr(grasp, "_grasps_of", lambda *arguments: ([], next(reasons)))
    with pytest.raises(GraspError, match="too wide by itself"):
        plan_grasps(cloud_of([Cube(0.45, 0.0)]), PlanarPose(0.45, 0.0, 0.0), workspace)
