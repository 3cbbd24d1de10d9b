"""The kitting shapes: the table's extents, real holes, symmetries that hold, and pinches that do not turn a thing."""

import math
from collections.abc import Callable, Iterator
from typing import Any

import cv2
import numpy as np
import pytest

from cliport_core import PlanarPose
from sim_bridge.bullet import pybullet
from sim_bridge.geometry.outlines import signed_area
from sim_bridge.objects.convex_pieces import convex_pieces
from sim_bridge.objects.kit import HOLE_RGB, KIT_SIZE, hole_poses, hole_shape
from sim_bridge.objects.kit_shapes import KIT_SHAPES, SEEN_SHAPES, THICKNESS, UNSEEN_SHAPES, kit_shape
from sim_bridge.objects.outline import Outline
from sim_bridge.scene import reset_scene
from sim_bridge.task_mechanics.pinches import gripper_at
from sim_bridge.world import SimWorld

# name, extents [mm], period of the metric: docs/benchmark.md, "Kitting shapes"
TABLE = [
    ("letter R shape", 40.5, 56.7, math.tau),
    ("letter A shape", 49.9, 57.0, math.tau),
    ("triangle", 60.0, 60.0, math.tau / 3),
    ("square", 60.0, 60.0, math.tau / 4),
    ("plus", 60.0, 60.0, math.tau / 4),
    ("letter T shape", 60.0, 60.0, math.tau),
    ("diamond", 75.0, 60.0, math.tau / 2),
    ("pentagon", 57.2, 54.4, math.tau / 5),
    ("rectangle", 75.0, 45.0, math.tau / 2),
    ("flower", 60.0, 60.0, math.tau / 4),
    ("star", 57.5, 60.5, math.tau / 5),
    ("circle", 60.0, 60.0, 0.0),
    ("letter G shape", 45.4, 58.2, math.tau),
    ("letter V shape", 47.0, 56.7, math.tau),
    ("letter E shape", 32.0, 56.7, math.tau),
    ("letter L shape", 60.0, 60.0, math.tau),
    ("ring", 60.0, 60.0, 0.0),
    ("hexagon", 52.0, 60.0, math.tau / 6),
    ("heart", 57.5, 52.8, math.tau),
    ("letter M shape", 54.0, 56.7, math.tau),
]
BY_NAME = {row[0]: i for i, row in enumerate(TABLE)}


@pytest.fixture(scope="module")
def world() -> Iterator[SimWorld]:
    world = SimWorld()
    yield world
    world.close()


def test_names_periods_and_extents_are_the_tables() -> None:
    assert [(shape.name, shape.period) for shape in KIT_SHAPES] == [(name, period) for name, _, _, period in TABLE]
    assert [len(SEEN_SHAPES), *UNSEEN_SHAPES] == [14, *range(14, 20)]
    for i, (name, x, y, _) in enumerate(TABLE):
        low, high = kit_shape(i).mesh.vertices.min(axis=0), kit_shape(i).mesh.vertices.max(axis=0)
        assert (high - low)[:2] * 1000 == pytest.approx([x, y], abs=1.0), name
        assert np.abs(low + high).max() < 1e-4, name
        assert (high - low)[2] == pytest.approx(THICKNESS)


@pytest.mark.parametrize("index", range(len(TABLE)))
def test_convex_pieces_cover_the_outline_and_no_more(index: int) -> None:
    outline = KIT_SHAPES[index].outline()
    pieces = convex_pieces(outline.corners, outline.holes)
    for piece in pieces:
        hull = cv2.convexHull(piece.astype(np.float32)).reshape(-1, 2).astype(np.float64)
        assert abs(signed_area(hull)) == pytest.approx(signed_area(piece), rel=1e-3)
    whole = sum(signed_area(ring) for ring in (outline.corners, *outline.holes))
    assert sum(signed_area(piece) for piece in pieces) == pytest.approx(whole, rel=1e-6)


@pytest.mark.parametrize("index", range(len(TABLE)))
def test_rests_on_the_table_as_thick_as_it_is_seen(world: SimWorld, index: int) -> None:
    thing = world.add(kit_shape(index), PlanarPose(0.45, 0.1, 0.3).as_pose(THICKNESS / 2 + 0.002))
    for _ in range(60):
        world.step()
    height = world.object_pose(thing).translation[2]
    world.remove(thing)
    assert height == pytest.approx(THICKNESS / 2, abs=3e-4)


@pytest.mark.parametrize(
    ("name", "empty", "solid"),
    [
        ("ring", (0.0, 0.0), (0.021, 0.0)),
        ("letter A shape", (0.0, -2.5e-3), (0.0, -0.0125)),
        ("letter R shape", (-2e-3, 12e-3), (-14e-3, 12e-3)),
        ("letter T shape", (-15e-3, 15e-3), (-15e-3, 0.0)),
        ("letter V shape", (0.0, 10e-3), (0.0, -20e-3)),
        ("letter E shape", (8e-3, 11e-3), (8e-3, 0.0)),
        ("plus", (22e-3, 22e-3), (22e-3, 0.0)),
    ],
)
def test_a_ray_goes_through_a_hole_and_not_through_a_bar(
    world: SimWorld, name: str, empty: tuple[float, float], solid: tuple[float, float]
) -> None:
    at = PlanarPose(0.45, 0.1, 0.7)
    thing = world.add(kit_shape(BY_NAME[name]), at.as_pose(THICKNESS / 2))
    world.step()
    hit = {place: _hit_from_above(world, at.as_pose().apply(np.array([*place, 0.0]))) for place in (empty, solid)}
    world.remove(thing)
    assert hit[solid] == thing.body and hit[empty] not in (thing.body, -1)


@pytest.mark.parametrize("index", range(len(TABLE)))
def test_a_turn_by_the_symmetry_maps_the_outline_on_itself(index: int) -> None:
    shape = KIT_SHAPES[index]
    assert kit_shape(index).symmetry == shape.symmetry
    # round ones look the same after any turn that their corners allow
    assert _off_after_turn(shape.outline(), shape.symmetry or math.tau / 4) < 2e-4
    # the table's period is too short for one: the triangle is not equilateral
    assert (shape.period == shape.symmetry) is (shape.name != "triangle")
    assert (_off_after_turn(shape.outline(), shape.period or math.tau / 4) < 2e-4) is (shape.name != "triangle")


def test_letters_and_the_heart_look_the_same_after_no_turn() -> None:
    for shape in KIT_SHAPES:
        if shape.symmetry == math.tau:
            assert min(_off_after_turn(shape.outline(), math.radians(a)) for a in range(30, 331, 10)) > 2e-3, shape.name


@pytest.mark.parametrize("index", range(len(TABLE)))
def test_the_best_pinch_lifts_the_shape_without_turning_it(
    world: SimWorld, scripted_hand: Callable[[SimWorld], Any], index: int
) -> None:
    reset_scene(world, "packing-unseen-shapes", "val", 0)
    for thing in world.objects:
        world.remove(thing)
    pinch = kit_shape(index).pinches[0]
    here = PlanarPose(0.45, 0.1, -pinch.yaw)
    thing = world.add(kit_shape(index), here.as_pose(THICKNESS / 2))
    at = gripper_at(here, pinch)
    hand = scripted_hand(world)
    hand.fingers(0.08, seconds=0.3)
    hand.go(at.x, at.y, 0.05, math.pi / 2, seconds=0.8)
    hand.go(at.x, at.y, 0.0145, math.pi / 2, seconds=0.4)
    assert hand.fingers(0.0, seconds=0.5) == pytest.approx(pinch.width, abs=0.0025)
    hand.go(at.x, at.y, 0.10, math.pi / 2, seconds=0.5)
    lifted = world.planar_pose(thing)
    world.remove(thing)
    assert math.hypot(lifted.x - here.x, lifted.y - here.y) < 0.004
    assert abs(math.remainder(lifted.yaw - here.yaw, math.tau)) < math.radians(4.0)


def test_prints_are_thin_dark_and_only_seen() -> None:
    poses = hole_poses(PlanarPose(0.4, 0.1, math.pi / 2).as_pose(KIT_SIZE[2] / 2))
    assert poses[0].translation == pytest.approx([0.4 - 0.045, 0.1 - 0.09, KIT_SIZE[2]])
    for i, shape in enumerate(KIT_SHAPES):
        hole = hole_shape(i)
        assert hole.name == f"{shape.name} hole" and hole.collision is None and not hole.pinches
        assert hole.footprint == pytest.approx(kit_shape(i).footprint)
        assert np.ptp(hole.mesh.vertices[:, 2]) < 0.001
        assert hole.mesh.colors is not None and (hole.mesh.colors == HOLE_RGB).all()


def _hit_from_above(world: SimWorld, at: np.ndarray) -> int:
    start, end = (at[0], at[1], 0.3), (at[0], at[1], -0.1)
    return int(pybullet.rayTest(start, end, physicsClientId=world.client)[0][0])


def _off_after_turn(outline: Outline, yaw: float) -> float:
    """The farthest that a corner, turned about the area's centroid, lies beside the outline [m]."""
    rings = [(ring - outline.centroid).astype(np.float64) for ring in (outline.corners, *outline.holes)]
    c, s = math.cos(yaw), math.sin(yaw)
    off = []
    for ring in rings:
        polygon = (ring * 1000).astype(np.float32)
        for x, y in ring * 1000:
            off.append(abs(cv2.pointPolygonTest(polygon, (c * x - s * y, s * x + c * y), True)) / 1000)
    return max(off)
