"""Things are set onto what lies beneath them, and moved as the gripper would move them."""

import math
from collections.abc import Iterator

import numpy as np
import pytest

from cliport_benchmark.kinematic_hand import KinematicHand
from cliport_benchmark.observer import Observer
from cliport_benchmark.setting_down import set_down
from cliport_core import PickPlaceAction, PlanarPose, Pose
from sim_bridge.objects import SceneObject, block_shape, bowl_shape, container_shape
from sim_bridge.objects.block import BLOCK_SIZE
from sim_bridge.objects.bowl import BOWL_FLOOR, BOWL_HEIGHT
from sim_bridge.world import SimWorld

HALF = BLOCK_SIZE / 2


@pytest.fixture
def world() -> Iterator[SimWorld]:
    world = SimWorld()
    yield world
    world.close()


@pytest.fixture
def block(world: SimWorld) -> SceneObject:
    return world.add(block_shape(), PlanarPose(0.3, -0.3, 0.0).as_pose(HALF), "red")


def height_after(world: SimWorld, block: SceneObject, x: float, y: float, yaw: float = 0.3) -> float:
    """Return the height of the block's underside, set down at x, y from a height that does not matter."""
    set_down(world, block, PlanarPose(x, y, yaw).as_pose(0.11))
    pose = world.object_pose(block)
    np.testing.assert_allclose(pose.translation[:2], (x, y), atol=1e-6)
    assert world.object_yaw(block) == pytest.approx(yaw, abs=1e-6)
    return float(pose.translation[2]) - HALF


def test_a_block_comes_down_on_whatever_is_there(world: SimWorld, block: SceneObject) -> None:
    world.add(bowl_shape(), PlanarPose(0.4, 0.2, 0.0).as_pose(BOWL_HEIGHT / 2), "green", fixed=True)
    world.add(block_shape(), PlanarPose(0.5, 0.0, 0.0).as_pose(HALF), "blue")
    for x, y, beneath in ((0.35, 0.0, 0.0), (0.4, 0.2, BOWL_FLOOR), (0.5, 0.015, BLOCK_SIZE), (0.5, 0.06, 0.0)):
        assert -1e-6 <= height_after(world, block, x, y) - beneath <= 0.0015


def test_beside_a_wall_it_comes_all_the_way_down(world: SimWorld, block: SceneObject) -> None:
    world.add(container_shape(0.2, 0.2), PlanarPose(0.45, 0.0, 0.0).as_pose(0.025), "brown", fixed=True)
    inside = 0.45 + 0.099 - HALF - 0.0004  # less than half a millimetre from the wall
    assert height_after(world, block, inside, 0.0, yaw=0.0) < 0.006


def test_the_hand_turns_things_about_the_pick_and_scatters_as_the_arm(world: SimWorld, block: SceneObject) -> None:
    frame = Observer(world.config).frame(world)
    hand = KinematicHand(world, np.random.default_rng(0))
    errors = []
    for _ in range(20):
        world.move_object(block, PlanarPose(0.3, -0.3, 0.0).as_pose(HALF))
        hand.execute(PickPlaceAction(PlanarPose(0.31, -0.3, 0.2), PlanarPose(0.5, 0.1, 0.2 + math.pi / 2)), frame)
        at = world.planar_pose(block)
        errors.append((at.x - 0.5, at.y - 0.09, at.yaw - math.pi / 2))
    spread = np.sqrt(np.mean(np.square(errors), axis=0))
    assert (spread[:2] > 4e-4).all() and (spread[:2] < 2e-3).all() and spread[2] < math.radians(1.2)


def test_where_nothing_lies_nothing_moves(world: SimWorld, block: SceneObject) -> None:
    frame = Observer(world.config).frame(world)
    before = world.object_pose(block).translation
    KinematicHand(world, np.random.default_rng(0)).execute(
        PickPlaceAction(PlanarPose(0.5, 0.3, 0.0), PlanarPose(0.5, 0.0, 0.0)), frame
    )
    np.testing.assert_allclose(world.object_pose(block).translation, before, atol=1e-3)


def test_attitude_is_kept(world: SimWorld, block: SceneObject) -> None:
    lying = Pose.from_xyz_rpy((0.3, 0.3, 0.1), (0.0, math.pi / 4, 0.0))
    set_down(world, block, lying)
    np.testing.assert_allclose(world.object_pose(block).rotation, lying.rotation, atol=1e-6)
    assert world.object_pose(block).translation[2] == pytest.approx(HALF * math.sqrt(2.0), abs=0.0015)
