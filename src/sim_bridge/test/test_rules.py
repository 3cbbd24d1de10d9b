"""Rules of the simulator at their limits: parameters, free ground, folds, sizes and seeds."""

from __future__ import annotations

import dataclasses
import math
from types import SimpleNamespace

import numpy as np
import pytest

from cliport_core import Pose, Primitive, WorkspaceSpec
from sim_bridge.control.trajectory_spline import TrajectorySpline, as_knot
from sim_bridge.errors import SimulationError
from sim_bridge.everyday.everyday_object import EverydayObject
from sim_bridge.everyday.merging import merged
from sim_bridge.geometry.mesh import TriangleMesh
from sim_bridge.objects import BoxPart, Collision, CylinderPart, Shape, cuboid
from sim_bridge.objects.collision import HullPart
from sim_bridge.objects.convex_pieces import convex_pieces
from sim_bridge.objects.outline import Outline, arc
from sim_bridge.scene import LARGEST_SEED, Stream, scene_rng
from sim_bridge.task_mechanics.folding import _caught, next_fold
from sim_bridge.task_mechanics.goal import LATTICE, lattice
from sim_bridge.task_mechanics.object_at import object_at
from sim_bridge.task_mechanics.placing import _box, _points_within, border_distance, distance_to_things, outline
from sim_bridge.task_mechanics.task import Split


def test_the_random_numbers_of_a_scene_are_part_of_every_result() -> None:
    assert {stream.name: int(stream) for stream in Stream} == {
        "SCENE": 0, "NOISE": 1, "HAND": 2, "GOALS": 3, "SCORED_NOISE": 4, "CHANCE": 5, "AGENT": 6, "PAINT": 7,
        "MISTAKES": 8, "CLUTTER": 16,
    }  # fmt: skip
    drawn = [int(scene_rng("align-rope", Split.VAL, 5, stream).integers(1_000_000)) for stream in (0, 1, 16)]
    again = [int(scene_rng("align-rope", split, seed).integers(1_000_000)) for split in Split for seed in (5, 6)]
    assert len({*drawn, *again}) == 8, "the scene of val and seed 5 is in both"
    assert scene_rng("a", Split.TEST, LARGEST_SEED) is not None and LARGEST_SEED == 9223372036854775807
    for seed in (-1, LARGEST_SEED + 1):
        with pytest.raises(SimulationError, match="seed must be 0 to"):
            scene_rng("a", Split.TEST, seed)


WORKSPACE = WorkspaceSpec(x_min=0.0, x_max=0.05, y_min=0.0, y_max=0.03, pixel_size=0.01)


class Ground:
    """A world of things that lie where a test says."""

    def __init__(self, **things: tuple[float, float, float]) -> None:
        self.config = SimpleNamespace(workspace=WorkspaceSpec(x_min=0.0, x_max=0.4, y_min=0.0, y_max=0.4))
        shape = cuboid("box", (0.1, 0.04, 0.02), 0.1)
        self.objects = [
            SimpleNamespace(mesh=shape.mesh, shape=shape, fixed="fixed" in name, name=name) for name in things
        ]
        self._poses = dict(zip(map(id, self.objects), things.values(), strict=True))

    def object_pose(self, thing: object) -> Pose:
        x, y, yaw = self._poses[id(thing)]
        return Pose.from_xyz_rpy((x, y, 0.01), (0.0, 0.0, yaw))


def test_the_distance_to_the_border() -> None:
    distance = border_distance(WORKSPACE)
    expected = [[5, 5, 5, 5, 5], [5, 15, 15, 15, 5], [5, 5, 5, 5, 5]]
    assert 1000 * distance == pytest.approx(np.array(expected, float))


def test_the_distance_to_things_as_they_lie() -> None:
    world = Ground(box=(0.2, 0.1, math.pi / 2))
    assert sorted(map(tuple, outline(world, world.objects[0]).round(3).tolist())) == [  # type: ignore[arg-type]
        (0.18, 0.05), (0.18, 0.15), (0.22, 0.05), (0.22, 0.15),
    ]  # fmt: skip
    distance = distance_to_things(world, world.objects)  # type: ignore[arg-type]
    spec = world.config.workspace
    for x, y, away in ((0.2, 0.1, 0.0), (0.2, 0.14, 0.0), (0.3, 0.1, 0.08), (0.2, 0.25, 0.1), (0.25, 0.19, 0.05)):
        assert distance[spec.xy_to_pixel(x, y)] == pytest.approx(away, abs=0.003)
    assert np.isinf(distance_to_things(world, [])).all()  # type: ignore[arg-type]


def test_a_box_around_a_thing_has_points_on_its_sides() -> None:
    vertices = np.array([(-0.03, -0.01, 0.0), (0.03, 0.01, 0.02), (0.0, 0.0, 0.05)])
    thing = SimpleNamespace(mesh=SimpleNamespace(vertices=vertices))
    world = SimpleNamespace(object_pose=lambda _: Pose.from_xyz_rpy((0.4, 0.1, 0.0), (0.0, 0.0, math.pi / 2)))
    points = _box(world, thing)  # type: ignore[arg-type]
    across, along = np.abs(points.T)
    assert len(points) == 12 and across.max() == pytest.approx(0.01) and along.max() == pytest.approx(0.03)
    assert (np.isclose(across, 0.01) | np.isclose(along, 0.03)).all(), "each lies on a side"
    found = {(round(float(a), 3), round(float(b), 3)) for a, b in zip(across, along, strict=True)}
    assert found == {(0.01, 0.03), (0.01, 0.01), (0.003, 0.03)}


def test_points_on_and_in_an_outline_are_two_centimetres_apart() -> None:
    corners = np.array([(-0.05, -0.02), (0.05, -0.02), (0.05, 0.02), (-0.05, 0.02)])
    points = _points_within(corners)
    assert (np.abs(points) <= (0.05 + 1e-9, 0.02 + 1e-9)).all()
    for corner in corners:
        assert np.abs(points - corner).sum(axis=1).min() < 1e-9
    rng = np.random.default_rng(0)
    anywhere = rng.uniform(-1.0, 1.0, (200, 2)) * (0.05, 0.02)
    gaps = np.linalg.norm(anywhere[:, None] - points[None], axis=-1).min(axis=1)
    assert gaps.max() < 0.0142 and len(points) == 4 + 8 + 16 + 20, "rings of a third, two thirds and the whole"


def test_the_points_of_a_box_that_are_counted() -> None:
    points = lattice((0.0, -0.02, 0.0), (0.05, 0.04, 0.0))
    assert LATTICE == 0.02 and points.tolist() == [[x, y, 0.0] for x in (0.0, 0.02, 0.04) for y in (-0.02, 0.0)]


def rope(*moved: tuple[int, float, float]) -> tuple[np.ndarray, np.ndarray]:
    """Return beads along x, 1.4 cm apart, some of which lie beside it, and their slots."""
    slots = np.column_stack([0.3 + 0.014 * np.arange(20), np.zeros(20)])
    beads = slots.copy()
    for index, dx, dy in moved:
        beads[index] += (dx, dy)
    return beads, slots


def test_a_rope_that_lies_right_is_left_alone() -> None:
    assert next_fold(*rope()) == (-1, None)
    assert next_fold(*rope((7, 0.0, 0.0099))) == (-1, None)
    beads, slots = rope()
    assert next_fold(beads, slots[::-1]) == (-1, None), "either end may come first"
    assert next_fold(*rope((7, 0.0, 0.0101)))[0] == 7


def test_the_bead_that_is_farthest_away_is_taken_to_its_slot() -> None:
    index, action = next_fold(*rope((0, -0.02, 0.05), (19, 0.0, 0.09)))
    assert index == 19 and action is not None and action.primitive is Primitive.FOLD
    assert (action.pick.x, action.pick.y) == pytest.approx((0.566, 0.09))
    assert (action.place.x, action.place.y) == pytest.approx((0.566, 0.0))
    tangent = math.atan2(0.09, 0.014)  # from the bead before it
    across = abs(math.remainder(action.pick.yaw - tangent - math.pi / 2, math.pi))
    assert across <= math.radians(45.0) + 1e-9
    assert math.remainder(action.place.yaw - action.pick.yaw + tangent, math.tau) == pytest.approx(0.0, abs=1e-9)


def test_a_bead_that_was_tried_in_vain_waits() -> None:
    tries = np.zeros(20, dtype=np.int64)
    tries[19] = 1
    assert next_fold(*rope((0, -0.02, 0.05), (19, 0.0, 0.09)), tries)[0] == 0
    assert next_fold(*rope((19, 0.0, 0.09)), tries)[0] == 19


@pytest.mark.parametrize(
    ("along", "across", "caught"),
    [(8, 0, 1), (6.5, 0, 0), (38, 0, 1), (38.5, 0, 0), (-20, 18, 1), (-20, -18, 1), (20, 19, 0), (0, 0, 0)],
)
@pytest.mark.parametrize("yaw", [0.0, 0.6])
def test_the_beads_under_the_opened_fingers(along: float, across: float, caught: int, yaw: float) -> None:
    """They open to 3 cm, are 15.2 mm thick and 21 mm wide; a bead has a radius of 8 mm."""
    c, s = math.cos(yaw), math.sin(yaw)
    other = np.array([0.4, 0.1]) + 0.001 * np.array([c * along - s * across, s * along + c * across])
    assert _caught(np.array([(0.4, 0.1), other]), 0, yaw) == caught


@pytest.mark.parametrize(
    ("edge", "share", "size"),
    [
        (0.1, 1.0, (0.05, 0.04, 0.02)),  # five times the edge: half of its size, but no thinner than 2 cm
        (0.2, 1.0, (0.1, 0.08, 0.04)),
        (0.4, 0.5, (0.1, 0.08, 0.04)),
        (0.02, 1.0, (0.02, 0.02, 0.016)),  # no more than four times as thick
    ],
)
def test_an_everyday_object_is_sized_for_its_cell(edge: float, share: float, size: tuple[float, ...]) -> None:
    mesh = TriangleMesh.box((0.1, 0.08, 0.04))
    thing = EverydayObject.centred("thing", mesh, [mesh.vertices.astype(np.float64)])
    shape = thing.sized(edge, share)
    assert np.ptp(shape.mesh.vertices, axis=0) == pytest.approx(size, abs=1e-6)
    assert (shape.mass, shape.friction, shape.rolling_friction) == (0.1, 1.0, 0.002)
    assert shape.collision is not None
    assert np.ptp(shape.collision.parts[0].corners, axis=0) == pytest.approx(size, abs=1e-6)


def test_an_object_is_about_its_centre_of_mass() -> None:
    small, large = (TriangleMesh.box((edge, 0.02, 0.02)) for edge in (0.02, 0.06))
    places = ((small, (0.0, 0.0, 0.0)), (large, (0.1, 0.0, 0.05)))
    pieces = [part.vertices.astype(np.float64) + np.array(at) for part, at in places]
    thing = EverydayObject.centred("thing", small, pieces)
    # a quarter of the mass at (0, 0), three at (10, 5) cm
    assert thing.mesh.vertices.mean(axis=0) == pytest.approx([-0.075, 0.0, -0.0375], abs=1e-6)
    middles = sorted(tuple(piece.mean(axis=0).round(4).tolist()) for piece in thing.pieces)
    assert middles == [(-0.075, 0.0, -0.0375), (0.025, 0.0, 0.0125)]
    with pytest.raises(SimulationError, match="has no volume"):
        EverydayObject.centred("nothing", small, [])


def test_pieces_are_merged_where_that_adds_a_hundredth_of_the_whole() -> None:
    def at(x: float, gap: float = 0.0) -> np.ndarray:
        return TriangleMesh.box((0.02, 0.02, 0.02)).vertices.astype(np.float64) + np.array([x + gap, 0.0, 0.0])

    assert len(merged([at(0.0), at(0.02, 0.00035)])) == 1, "0.9 % of both"
    assert len(merged([at(0.0), at(0.02, 0.00045)])) == 2, "1.1 %"
    assert len(merged([at(0.03 * i) for i in range(12)])) == 12
    assert len(merged([at(0.03 * i) for i in range(14)])) == 12, "so many pieces at most"


def test_parts_of_a_collision() -> None:
    quarter = Pose.from_xyz_rpy((0.1, 0.0, 0.0), (0.0, 0.0, math.pi / 2))
    corners = BoxPart((0.02, 0.04, 0.06), quarter).corners
    assert corners.shape == (8, 3) and corners.min(axis=0) == pytest.approx([0.08, -0.01, -0.03])
    assert corners.max(axis=0) == pytest.approx([0.12, 0.01, 0.03])
    around = CylinderPart(0.05, 0.1, Pose.identity()).corners
    assert around.shape == (24, 3) and np.ptp(around[:, 2]) == pytest.approx(0.1)
    assert np.linalg.norm(around[:, :2], axis=1) == pytest.approx(0.05 / math.cos(math.pi / 12))
    box, hull = BoxPart((0.1, 0.1, 0.1), Pose.identity()), HullPart(corners)
    assert len(Collision([box] * 16).parts) == 16 and len(Collision([hull] * 17).parts) == 17
    for parts in ([], [box] * 17, [box, hull]):
        with pytest.raises(SimulationError, match="collision shape"):
            Collision(parts)  # type: ignore[arg-type]


def test_a_shapes_footprint_radius_and_bottom() -> None:
    mesh = TriangleMesh.box((0.06, 0.08, 0.02)).transformed(Pose.from_xyz_rpy((0.0, 0.0, 0.05), (0.0, 0.0, 0.0)))
    shape = Shape("box", mesh, None, 0.1)
    assert shape.radius == pytest.approx(0.05) and shape.bottom == pytest.approx(0.04)
    assert sorted(map(tuple, shape.footprint.round(3).tolist())) == [
        (-0.03, -0.04), (-0.03, 0.04), (0.03, -0.04), (0.03, 0.04),
    ]  # fmt: skip
    assert (shape.symmetry, shape.friction, shape.rolling_friction, shape.pinches) == (math.tau, 1.0, 1e-4, ())


L_SHAPE = [(0, 0), (40, 0), (40, 10), (10, 10), (10, 30), (0, 30)]  # [mm]


def test_an_outline_has_its_centroid_and_moves_inwards() -> None:
    outline = Outline.from_mm(L_SHAPE[::-1], [[(2, 2), (4, 2), (4, 4), (2, 4)]])
    area = 400.0 + 200.0 - 4.0
    middle = np.array([400.0 * 20 + 200.0 * 5 - 4.0 * 3, 400.0 * 5 + 200.0 * 20 - 4.0 * 3]) / area
    assert 1000 * outline.centroid == pytest.approx(middle)
    smaller = outline.inset(0.001)
    assert sorted(map(tuple, (1000 * smaller.corners).round(6).tolist())) == sorted(
        [(1, 1), (39, 1), (39, 9), (9, 9), (9, 29), (1, 29)]
    )
    assert np.ptp(1000 * smaller.holes[0], axis=0) == pytest.approx([4.0, 4.0])
    assert len(convex_pieces(L_SHAPE)) == 2
    assert arc((1.0, 2.0), (3.0, 5.0), 0.0, 180.0, 2) == [(4.0, 2.0), pytest.approx((1.0, 7.0))]


@pytest.mark.parametrize("degree", [1, 3, 5])
def test_a_spline_is_the_polynomial_that_its_knots_are_of(degree: int) -> None:
    """Knots of a polynomial of as high a degree as they can say: between them it is the same."""
    curve = np.polynomial.Polynomial([0.3, -0.7, 0.5, 1.1, -0.4, 0.2][: degree + 1])
    values = [curve, curve.deriv(), curve.deriv(2)]
    given = {1: 1, 3: 2, 5: 3}[degree]
    knots = [as_knot(t, *([float(value(t))] for value in values[:given])) for t in (0.5, 1.25, 3.0)]
    spline = TrajectorySpline(knots)
    assert (spline.start, spline.end) == (0.5, 3.0)
    for t in (0.5, 0.9, 1.25, 2.2, 2.999):
        assert np.ravel(spline.sample(t)) == pytest.approx([float(value(t)) for value in values], abs=1e-9)
    for t, where in ((0.2, 0.5), (3.0, 3.0), (9.0, 3.0)):
        assert np.ravel(spline.sample(t)) == pytest.approx([float(curve(where)), 0.0, 0.0])
    times, positions, velocities = spline.sweep(0.25)
    assert times.tolist() == [0.5, 0.75, 1.0, 1.25, *(1.25 + 0.25 * i for i in range(8))]
    assert positions[:, 0] == pytest.approx(curve(times)) and velocities[:, 0] == pytest.approx(curve.deriv()(times))


def test_one_knot_is_a_rest() -> None:
    spline = TrajectorySpline([as_knot(2.0, [0.1, 0.2])])
    assert [values.tolist() for values in spline.sample(7.0)] == [[0.1, 0.2], [0.0, 0.0], [0.0, 0.0]]
    times, positions, velocities = spline.sweep(0.1)
    assert (times.tolist(), positions.tolist(), velocities.tolist()) == ([2.0], [[0.1, 0.2]], [[0.0, 0.0]])
    with pytest.raises(ValueError, match="at least one knot"):
        TrajectorySpline([])


def test_the_nodes_parameters_and_their_limits() -> None:
    pytest.importorskip("rcl_interfaces")
    from sim_bridge.node_parameters import ParameterError, SimParameters

    values = dataclasses.asdict(SimParameters())
    assert values == {
        "task": "put-blocks-in-bowls-seen-colors", "split": "test", "seed": 0, "instruction": "",
        "camera_rate": 5.0, "joint_state_rate": 50.0, "clock_rate": 50.0, "real_time_factor": 1.0,
        "heartbeat_timeout": 0.2, "franka_quirks": True, "grasp_epsilon_inner": 0.005, "grasp_epsilon_outer": 0.005,
        "hand_fault": "", "mirror": "",
        "trajectory_log": "", "render_threads": 0, "robot": "panda", "base_frame": "panda_link0",
        "camera_mounting": "", "camera_kind": "plain", "camera_frame": "camera_color_optical_frame",
        "publish_camera_pose": True, "held_board": "",
        "arm_action": "/panda_arm_controller/follow_joint_trajectory",
        "gripper_action": "/panda_gripper/gripper_action", "heartbeat_topic": values["heartbeat_topic"],
    }  # fmt: skip
    limits = {
        "camera_rate": (0.1, 60.0, 0.01),
        "joint_state_rate": (1.0, 240.0, 0.01),
        "clock_rate": (1.0, 240.0, 0.01),
        "real_time_factor": (0.01, 100.0, 0.001),
        "heartbeat_timeout": (0.1, 60.0, 0.01),
        "grasp_epsilon_inner": (0.0, 0.08, 0.001),
        "grasp_epsilon_outer": (0.0, 0.08, 0.001),
        "seed": (0, 2**62, 1),
        "render_threads": (0, 1024, 1),
    }
    for name, (least, most, beyond) in limits.items():
        for value in (least, most):
            assert getattr(SimParameters(**{name: value}), name) == value
        for value in (least - beyond, most + beyond):
            with pytest.raises(ParameterError, match=f"parameter {name} must be in"):
                SimParameters(**{name: value})


def test_the_thing_at_a_place_or_else_the_nearest_is_found() -> None:
    world = Ground(under=(0.2, 0.2, 0.0), fixed_stand=(0.2, 0.2, math.pi / 2))

    def found(x: float, y: float, movable: bool) -> str | None:
        thing = object_at(world, x, y, movable)  # type: ignore[arg-type]
        return None if thing is None else thing.name

    assert found(0.24, 0.2, True) == "under" and found(0.2, 0.24, False) == "fixed_stand"
    assert found(0.2, 0.24, True) is None and found(0.3, 0.3, False) is None
    assert found(0.259, 0.2, True) == "under" and found(0.261, 0.2, True) is None, "a centimetre beside it"
    assert found(0.249, 0.223, False) == "under", "inside it counts more than beside the other"
