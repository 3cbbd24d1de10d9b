"""The links as spheres: points of their hulls, a sphere for each cube of space, and where the joints carry them."""

from __future__ import annotations

import itertools
import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from scipy.spatial import ConvexHull

from panda_executor.arm_cover import ArmCover, _hull_surface, _spheres
from panda_executor.model import PandaModel
from panda_model import FloatArray, load_preset

READY = load_preset().ready
STEP, CUBE = 0.008, 0.05  # between two points of a hull, and the edge of a sphere's cube [m]
FINE_CUBE = 0.02  # and of that of each of its parts [m]


def rows(points: FloatArray) -> set[tuple[float, ...]]:
    return {tuple(point) for point in np.round(points, 9).tolist()}


@pytest.mark.parametrize("order", list(itertools.permutations(range(3))))
def test_a_hull_is_sampled_on_every_face_by_its_longest_edge(order: tuple[int, ...]) -> None:
    """Each of a triangle's edges may be the longest, in whatever order its corners come; inner points are left out."""
    corners = np.array([[0.0, 0.0, 0.0], [0.1, 0.01, 0.0], [0.02, 0.03, 0.005], [0.0, 0.02, 0.047]])[:, order]
    vertices = np.concatenate([corners, [corners.mean(axis=0)]])
    expected = [corners]
    for triangle in itertools.combinations(corners, 3):
        n = math.ceil(max(math.dist(*pair) for pair in itertools.combinations(triangle, 2)) / STEP)
        a, b, c = triangle
        for i, j in itertools.product(range(n + 1), repeat=2):
            if i + j <= n:
                expected.append((a + i / n * (b - a) + j / n * (c - a))[None])
    assert rows(_hull_surface(vertices)) == rows(np.concatenate(expected))
    assert len(ConvexHull(vertices).simplices) == 4


@pytest.mark.parametrize("edge", [CUBE, FINE_CUBE])
def test_there_is_one_sphere_for_each_cube_with_points(edge: float) -> None:
    rng = np.random.default_rng(0)
    points = rng.uniform((0.3, -0.2, 0.0), (0.42, -0.12, 0.2), (300, 3))
    lowest, cubes = points.min(axis=0), dict[tuple[int, ...], list[FloatArray]]()
    for point in points:
        cubes.setdefault(tuple(math.floor(v) for v in (point - lowest) / edge), []).append(point)
    found = _spheres(points, edge, joint=4, part_of=7)
    assert len(found) == len(cubes) and (edge != CUBE or len(cubes) == 3 * 2 * 4)
    assert {(sphere.joint, sphere.part_of) for sphere in found} == {(4, 7)}
    assert sum(len(sphere.points) for sphere in found) == len(points)
    expected = []
    for mine in cubes.values():
        middle = (np.min(mine, axis=0) + np.max(mine, axis=0)) / 2.0
        radius = max(math.dist(point, middle) for point in mine) + STEP / 2.0
        expected.append([*middle, radius])
    assert rows(np.array([[*sphere.centre, sphere.radius] for sphere in found])) == rows(np.array(expected))


def test_one_point_is_a_sphere_of_half_a_step() -> None:
    (sphere,) = _spheres(np.array([[0.1, 0.2, 0.3]]), CUBE)
    assert sphere.centre.tolist() == [0.1, 0.2, 0.3] and sphere.radius == pytest.approx(STEP / 2.0)


def test_spheres_move_with_the_joint_that_carries_them(model: PandaModel) -> None:
    rng = np.random.default_rng(1)
    joints = np.array([5, 2, 7, 2, 5, 1])
    cover = ArmCover(joints, rng.normal(size=(6, 3)), np.full(6, 0.1))
    pin.forwardKinematics(model.model, model.data, READY + rng.normal(0.0, 0.5, 7))
    expected = [model.data.oMi[int(joint)].act(centre) for joint, centre in zip(joints, cover.centres, strict=True)]
    np.testing.assert_allclose(cover.placed(model.data), expected, atol=1e-12)


def test_only_the_named_links_have_spheres_each_with_its_own_joint() -> None:
    """Three cubes of 2 cm on links that are turned and shifted on their joints."""
    corners = np.array(list(itertools.product((-0.01, 0.01), repeat=3)))
    turned = pin.exp3(np.array([0.0, 0.0, math.pi / 2.0]))
    frames = [SimpleNamespace(name=name) for name in ("arm_link1", "arm_link2", "arm_link3")]
    items = [
        SimpleNamespace(
            parentFrame=frame,
            parentJoint=frame + 4,
            placement=pin.SE3(turned, np.array([0.1, 0.2, 0.3 + frame])),
            geometry=SimpleNamespace(points=lambda: corners + np.array([0.05, 0.0, 0.0])),
        )
        for frame in (2, 0, 1)
    ]
    model: Any = SimpleNamespace(frames=frames)
    geometry: Any = SimpleNamespace(geometryObjects=items)
    cover = ArmCover.of_links(model, geometry, ("arm_link3", "arm_link2"))
    assert cover.joints.tolist() == [6, 5]
    np.testing.assert_allclose(cover.centres, [[0.1, 0.25, 2.3], [0.1, 0.25, 1.3]], atol=1e-12)
    np.testing.assert_allclose(cover.radii, 0.01 * math.sqrt(3.0) + STEP / 2.0)
    none = ArmCover.of_links(model, geometry, ())
    assert none.centres.shape == (0, 3) and len(none.joints) == len(none.radii) == 0


def test_the_arms_spheres_are_of_its_links_and_not_larger_than_their_cubes_need(model: PandaModel) -> None:
    assert set(model.standing.joints.tolist()) == {0, 1, 2}
    assert set(model.reaching.joints.tolist()) == {3, 4, 5, 6, 7}
    for cover in (model.standing, model.reaching):
        assert cover.radii.max() <= CUBE * math.sqrt(3.0) / 2.0 + STEP / 2.0 + 1e-9
    centres, radii = model.own_spheres(READY)
    np.testing.assert_array_equal(radii, [*model.standing.radii, *model.reaching.radii])
    expected = [*model.standing.placed(model.data), *model.reaching.placed(model.data)]
    np.testing.assert_array_equal(centres, expected)


def test_parts_hold_the_points_that_their_spheres_hold_and_stand_out_less(model: PandaModel) -> None:
    """Every sampled point of a hull lies in a sphere and in a part of that very sphere."""
    for cover, names in ((model.standing, range(3)), (model.reaching, range(3, 8))):
        parts = cover.parts
        assert parts is not None and parts.parts is None
        assert set(parts.part_of.tolist()) == set(range(len(cover.radii)))
        np.testing.assert_array_equal(parts.joints, cover.joints[parts.part_of])
        assert parts.radii.max() <= FINE_CUBE * math.sqrt(3.0) / 2.0 + STEP / 2.0 + 1e-9
        for item in model.geometry.geometryObjects:
            if not any(item.name.startswith(model.link(f"link{number}_")) for number in names):
                continue
            points = _hull_surface(np.asarray(item.geometry.points()))[::40]
            points = points @ item.placement.rotation.T + item.placement.translation
            near = [
                np.linalg.norm(points[:, None] - it.centres, axis=2) <= it.radii - STEP / 2.0 + 1e-9
                for it in (cover, parts)
            ]
            near = [inside & (it.joints == item.parentJoint) for inside, it in zip(near, (cover, parts), strict=True)]
            assert (near[1] & near[0][:, parts.part_of]).any(axis=1).all()


def test_some_of_a_covers_spheres_can_be_placed_alone(model: PandaModel) -> None:
    pin.forwardKinematics(model.model, model.data, READY)
    which = np.array([3, 17, 40])
    np.testing.assert_array_equal(model.reaching.placed(model.data, which), model.reaching.placed(model.data)[which])
