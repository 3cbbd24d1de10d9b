"""Grasps of what is not a block by itself: rings in stacks, rims, bars, beads, and things too wide as a whole."""

from __future__ import annotations

import math

import numpy as np
import pytest
from synthetic_clouds import (
    Bowl,
    Cube,
    ball_points,
    bowl_points,
    cloud_of,
    cube_points,
    ring_points,
    seen_cloud,
)

from cliport_core.pose import PlanarPose
from cliport_core.workspace import WorkspaceSpec
from panda_executor.errors import GraspError
from panda_executor.grasp import Grasp, plan_grasps
from panda_model import load_preset

HAND = load_preset().hand

X, Y = 0.45, -0.1
BASE, THICK = 0.01, 0.02  # heights of a stand and of a ring [m]


def first(cloud: np.ndarray, yaw: float, workspace: WorkspaceSpec, x: float = X, y: float = Y) -> Grasp:
    return plan_grasps(cloud, PlanarPose(x, y, yaw), workspace)[0]


def tips(grasp: Grasp) -> float:
    return grasp.tcp_z - HAND.fingertip_below_tcp


def stand(rings: tuple[float, ...], seed: int = 0) -> np.ndarray:
    """Rings by outer radius, the lowest first, on the peg of a stand; the peg ends 10 mm above a single ring."""
    base = cube_points(Cube(X, Y, size=(0.12, 0.12, BASE)))
    peg = ring_points(X, Y, BASE, 0.005, 0.0, THICK + 0.01)
    stack = [ring_points(X, Y, BASE + i * THICK, radius) for i, radius in enumerate(rings)]
    return seen_cloud(base, peg, *stack, seed=seed)


@pytest.mark.parametrize("yaw", [0.0, 0.5, math.pi / 2])
@pytest.mark.parametrize("rings", [(0.025,), (0.035,), (0.035, 0.03), (0.03, 0.025), (0.035, 0.03, 0.025)])
def test_a_pick_in_a_hole_means_the_ring_around_it(
    workspace: WorkspaceSpec, rings: tuple[float, ...], yaw: float
) -> None:
    grasp = first(stand(rings), yaw, workspace)
    below = BASE + (len(rings) - 1) * THICK
    assert np.hypot(grasp.centroid[0] - X, grasp.centroid[1] - Y) < 0.002
    assert grasp.width == pytest.approx(2 * rings[-1], abs=0.004)
    assert grasp.top_z == pytest.approx(below + THICK, abs=0.004)  # neither the peg's nor a lower ring's
    assert grasp.support_z == pytest.approx(below, abs=0.003)
    assert below + 0.002 < tips(grasp) < below + THICK - 0.007  # beside this ring, above the ledge of the one below
    assert np.hypot(*grasp.footprint.T).min() > 0.009  # the hole stays free: a peg goes through it


def test_without_a_ring_the_peg_is_the_object(workspace: WorkspaceSpec) -> None:
    grasp = first(seen_cloud(ring_points(X, Y, 0.0, 0.008, 0.0, 0.03)), 0.0, workspace)
    assert grasp.width == pytest.approx(0.016, abs=0.004)


@pytest.mark.parametrize("gap", [0.006, 0.012])
def test_fingers_stay_above_what_they_would_close_over(workspace: WorkspaceSpec, gap: float) -> None:
    low = cube_points(Cube(X + 0.04 + gap, Y, size=(0.04, 0.04, 0.02)))
    grasp = first(seen_cloud(cube_points(Cube(X, Y)), low), 0.0, workspace)
    assert abs(math.cos(grasp.yaw)) == 1.0
    assert 0.02 < tips(grasp) <= 0.034


def test_fingers_open_no_wider_than_their_way_in_is_free(workspace: WorkspaceSpec) -> None:
    neighbour = cube_points(Cube(X + 0.04 + 0.024, Y))
    grasp = first(seen_cloud(cube_points(Cube(X, Y)), neighbour), 0.0, workspace)
    assert 0.041 < grasp.opening < HAND.opening
    assert grasp.opening / 2 + HAND.finger_thickness < 0.02 + 0.024
    assert tips(grasp) < 0.02


def test_a_block_on_two_others_is_taken_across_their_row(workspace: WorkspaceSpec) -> None:
    row = [Cube(X, Y + dy) for dy in (-0.025, 0.025)]
    cloud = seen_cloud(*(cube_points(cube) for cube in [*row, Cube(X, Y, z=0.04)]))
    grasp = first(cloud, 0.0, workspace)
    assert grasp.support_z == pytest.approx(0.04, abs=0.004)
    assert grasp.length == pytest.approx(0.04, abs=0.006)


BARS = {  # name: bars (x, y, size x, size y) [mm], jaws' yaw, width there, middle of the contacts along the jaws
    "T": ([(21, 0, 18, 60), (-9, 0, 42, 18)], math.pi / 2, 60, 0),
    "E": ([(-10, 0, 12, 57), (6, 23, 20, 11), (6, 0, 20, 11), (6, -23, 20, 11)], math.pi / 2, 57, 0),
    "L": ([(-21, 0, 18, 60), (9, -21, 42, 18)], 0.0, 60, 0),
    "P": ([(-21, 0, 18, 60), (6, 20, 36, 20)], 0.0, 54, -3),
}


@pytest.mark.parametrize("turn", [0.0, 0.7, 2.5])
@pytest.mark.parametrize("name", BARS)
def test_letters_are_held_between_the_contacts_and_at_their_centroid(
    workspace: WorkspaceSpec, name: str, turn: float
) -> None:
    bars, yaw, width, middle = BARS[name]
    c, s = math.cos(turn), math.sin(turn)
    mm = np.array(bars) / 1000.0
    cubes = [Cube(X + c * x - s * y, Y + s * x + c * y, turn, (w, d, 0.02)) for x, y, w, d in mm]
    area = mm[:, 2] * mm[:, 3]
    centroid = area @ mm[:, :2] / area.sum()
    closing, across = np.array([math.cos(yaw), math.sin(yaw)]), np.array([-math.sin(yaw), math.cos(yaw)])
    point = middle / 1000.0 * closing + (centroid @ across) * across
    pick = np.array([X, Y]) + np.array([[c, -s], [s, c]]) @ point
    grasp = first(seen_cloud(*(cube_points(cube) for cube in cubes)), yaw + turn, workspace, *pick)
    assert grasp.yaw == yaw + turn
    assert np.hypot(*(grasp.centroid[:2] - pick)) < 0.0025
    assert grasp.width == pytest.approx(width / 1000.0, abs=0.004)
    corner = max(math.hypot(abs(x) + w / 2, abs(y) + d / 2) for x, y, w, d in mm - [*centroid, 0, 0])
    assert np.hypot(*grasp.footprint.T).max() == pytest.approx(corner, abs=0.012)  # all of it, for the checks


@pytest.mark.parametrize("angle", [0.0, 1.0, 2.5, -2.0])
def test_a_bowl_is_pinched_at_its_rim(workspace: WorkspaceSpec, angle: float) -> None:
    bowl = Bowl(X, Y)
    radius = (bowl.outer + bowl.inner_rim) / 2
    x, y = X + radius * math.cos(angle), Y + radius * math.sin(angle)
    grasp = first(seen_cloud(bowl_points(bowl)), angle, workspace, x, y)
    assert grasp.yaw == angle
    assert np.hypot(grasp.centroid[0] - x, grasp.centroid[1] - y) < 0.005
    assert grasp.width < 0.018
    assert bowl.floor < tips(grasp) < bowl.height - 0.007
    assert grasp.length > 0.1  # the whole bowl comes along


def test_a_handle_of_something_wide(workspace: WorkspaceSpec) -> None:
    box, handle = Cube(X, Y, 0.3, (0.12, 0.1, 0.03)), Cube(X, Y, 0.3, (0.05, 0.02, 0.02), 0.03)
    grasp = first(seen_cloud(cube_points(box), cube_points(handle)), 0.3 + math.pi / 2, workspace)
    assert grasp.width == pytest.approx(0.02, abs=0.004)
    assert grasp.support_z == 0.0  # the box is lifted with it
    assert grasp.length == pytest.approx(0.12, abs=0.015)


def test_a_long_thing_is_held_where_the_pick_is(workspace: WorkspaceSpec) -> None:
    rod = Cube(X, Y, 0.4, (0.2, 0.02, 0.02))
    x, y = X + 0.06 * math.cos(0.4), Y + 0.06 * math.sin(0.4)
    grasp = first(seen_cloud(cube_points(rod)), 0.4 + math.pi / 2, workspace, x, y)
    assert np.hypot(grasp.centroid[0] - x, grasp.centroid[1] - y) < 0.003


def test_a_bead_of_a_rope(workspace: WorkspaceSpec) -> None:
    angle = np.linspace(0.0, 1.5 * math.pi, 20)
    beads = np.stack([X + 0.06 * np.cos(angle), Y + 0.06 * np.sin(angle)], -1)
    cloud = seen_cloud(*(ball_points(x, y, 0.0075) for x, y in beads))
    for i in (0, 7, 19):
        grasp = first(cloud, float(angle[i]), workspace, *beads[i])
        assert np.hypot(*(grasp.centroid[:2] - beads[i])) < 0.004
        assert 0.01 < grasp.width < 0.022
        assert tips(grasp) < 0.0075  # below the bead's middle


def test_a_bead_within_a_heap(workspace: WorkspaceSpec) -> None:
    row = [ball_points(X + dx, Y + dy, 0.0075) for dx in (-0.0141, 0, 0.0141) for dy in (-0.0141, 0, 0.0141)]
    top = [ball_points(X + dx, Y, 0.019) for dx in (-0.0141, 0.0, 0.0141)]
    grasp = first(seen_cloud(*row, *top), math.pi / 2, workspace)
    assert abs(grasp.centroid[1] - Y) < 0.003
    assert grasp.width < 0.025
    assert 0.01 < tips(grasp) < 0.02


def test_a_tall_neighbour_in_the_way_of_the_hand_is_named(workspace: WorkspaceSpec) -> None:
    things = [Cube(X + dx, Y + dy, size=(0.02, 0.02, 0.09)) for dx, dy in ((0.07, 0), (-0.07, 0), (0, 0.07))]
    cloud = cloud_of([Cube(X, Y, size=(0.04, 0.04, 0.015)), *things])
    with pytest.raises(GraspError, match="mm higher than it and in the way of the hand") as caught:
        plan_grasps(cloud, PlanarPose(X, Y, 0.0), workspace)
    assert "\n" not in str(caught.value)


def test_a_box_larger_than_the_crop(workspace: WorkspaceSpec) -> None:
    box = Cube(X, Y, 0.6, (0.07, 0.1, 0.05))
    grasp = first(seen_cloud(cube_points(box)), 0.6, workspace, X + 0.005, Y - 0.004)
    assert np.hypot(grasp.centroid[0] - X, grasp.centroid[1] - Y) < 0.003
    assert grasp.width == pytest.approx(0.07, abs=0.004)
    assert grasp.length == pytest.approx(0.1, abs=0.006)
