"""Metrics, the order of goals, free places and the expert's choice: what every task relies on."""

import math
from collections.abc import Iterator, Sequence

import numpy as np
import pytest

from cliport_core import PlanarPose, Pose
from sim_bridge.errors import LayoutError, PhysicsError
from sim_bridge.objects import block_shape, bowl_shape, container_shape, cuboid
from sim_bridge.scene import reset_scene, scene_rng
from sim_bridge.task_mechanics.goal import Goal, PoseMetric, ZoneMetric, lattice
from sim_bridge.task_mechanics.goal_task import GoalTask
from sim_bridge.task_mechanics.placing import FINGER_CLEARANCE, free_pose
from sim_bridge.tasks import TASKS, Split, make_task
from sim_bridge.world import SimWorld

HALF = 0.02


@pytest.fixture(scope="module")
def shared_world() -> Iterator[SimWorld]:
    world = SimWorld()
    yield world
    world.close()


@pytest.fixture
def world(shared_world: SimWorld) -> SimWorld:
    for thing in list(shared_world.objects):
        shared_world.remove(thing)
    return shared_world


class TwoBlocks(GoalTask):
    """Two blocks, one after the other, to two places."""

    max_steps = 4

    def set_up(self, world: SimWorld, rng: np.random.Generator) -> Sequence[Goal]:
        blocks = [world.add(block_shape(), PlanarPose(0.35, y, 0.2).as_pose(HALF), "red") for y in (-0.1, 0.1)]
        places = [PlanarPose(0.5, y, 0.0).as_pose(HALF) for y in (-0.1, 0.1)]
        return [
            Goal(f"block {i}", (b,), (p,), np.ones((1, 1), bool), PoseMetric(), 0.5, (math.pi / 2,))
            for i, (b, p) in enumerate(zip(blocks, places, strict=True))
        ]


def two_blocks(world: SimWorld) -> TwoBlocks:
    task = TwoBlocks("two-blocks", Split.VAL)
    task.reset(world, np.random.default_rng(0))
    return task


@pytest.mark.parametrize(
    ("x", "yaw", "value"),
    [
        (0.5, 0.0, 1.0),
        (0.5099, 0.0, 1.0),
        (0.5101, 0.0, 0.0),
        (0.5, math.radians(14), 1.0),
        (0.5, math.radians(16), 0.0),
        (0.5, math.radians(90 - 14), 1.0),
        (0.5, math.radians(45), 0.0),
    ],
)
def test_pose_metric_is_strict_and_knows_symmetry(world: SimWorld, x: float, yaw: float, value: float) -> None:
    task = two_blocks(world)
    goal = task.goals[0]
    world.move_object(goal.objects[0], PlanarPose(x, -0.1, yaw).as_pose(0.3))
    assert goal.value(world) == value


def test_goals_advance_one_at_a_time_and_are_never_looked_at_again(world: SimWorld) -> None:
    task = two_blocks(world)
    first, second = task.goals
    world.move_object(second.objects[0], second.targets[0])  # the wrong order counts only when its turn comes
    task.advance()
    assert task.score() == 0.0 and task.instruction == "block 0"
    world.move_object(first.objects[0], first.targets[0])
    assert task.score() == 0.0 and task.running_score() == 0.5
    task.advance()
    assert task.score() == 0.5 and not task.done() and task.present_goal is second
    task.advance()
    assert task.score() == 1.0 and task.done()
    world.move_object(first.objects[0], PlanarPose(0.3, 0.3, 0.0).as_pose(HALF))
    assert task.score() == 1.0
    task.advance()
    assert task.present_goal is None and task.expert_action() is None and task.instruction == "done."


def test_zone_metric_counts_the_points_inside(world: SimWorld) -> None:
    zone = PlanarPose(0.45, 0.1, 0.5).as_pose(0.025)
    box = cuboid("box", (0.06, 0.04, 0.05), 0.1)
    thing = world.add(box, zone, "red")
    points = lattice((-0.03, -0.02, -0.025), (0.06, 0.04, 0.05))
    assert len(points) == 3 * 2 * 3
    goal = Goal("in", (thing,), (zone,), np.ones((1, 1), bool), ZoneMetric((0.1, 0.1), (points,), 0.05), 1.0)
    assert goal.value(world) == 1.0 and goal.reached(world)
    world.move_object(thing, zone @ Pose.from_xyz_rpy((0.05, 0.0, 0.0), (0, 0, 0)))  # points at x 0.02 and more
    assert goal.value(world) == pytest.approx(2 / 3)
    world.move_object(thing, zone @ Pose.from_xyz_rpy((0.0, 0.0, 0.05), (0, 0, 0)))  # points at z 0.025..0.065
    assert goal.value(world) == pytest.approx(2 / 3)
    world.move_object(thing, zone @ Pose.from_xyz_rpy((0.2, 0.0, 0.0), (0, 0, 0)))
    assert goal.value(world) == 0.0


def test_the_expert_picks_across_what_is_narrow_and_turns_the_least(world: SimWorld) -> None:
    task = two_blocks(world)
    action = task.expert_action()
    assert action is not None and task.instruction == "block 0"
    assert (action.pick.x, action.pick.y) == pytest.approx((0.35, -0.1))
    assert (action.place.x, action.place.y) == pytest.approx((0.5, -0.1))
    assert action.place.yaw - action.pick.yaw == pytest.approx(-0.2)
    assert action.pick_yaw_period == pytest.approx(math.pi / 2)
    choice = task.judge(action.pick, action.place)
    assert choice.picked == "red block" and choice.pick_right and choice.place_right
    assert not task.judge(PlanarPose(0.35, 0.1, 0.0), action.place).pick_right
    assert not task.judge(action.pick, PlanarPose(0.5, 0.1, 0.0)).place_right
    assert task.judge(PlanarPose(0.6, 0.3, 0.0), action.place).picked == ""


def test_a_pick_beside_the_middle_is_judged_by_what_the_hand_does_with_it(world: SimWorld) -> None:
    task = two_blocks(world)
    action = task.expert_action()
    assert action is not None
    off = PlanarPose(action.pick.x + 0.014, action.pick.y, action.pick.yaw)
    assert task.judge(off, action.place).place_right
    assert not task.judge(off, action.place, exact_offset=True).place_right
    carried = action.place @ action.pick.inverse() @ off  # as far off at the place as at the pick
    assert task.judge(off, carried, exact_offset=True).place_right
    assert not task.judge(off, carried).place_right


def test_what_was_tried_in_vain_waits_for_something_else(world: SimWorld) -> None:
    class BothAtOnce(TwoBlocks):
        def set_up(self, world: SimWorld, rng: np.random.Generator) -> Sequence[Goal]:
            a, b = super().set_up(world, rng)
            return [
                Goal("both", a.objects + b.objects, a.targets + b.targets, np.eye(2, dtype=bool), PoseMetric(), 1.0)
            ]

    task = BothAtOnce("both-at-once", Split.VAL)
    task.reset(world, np.random.default_rng(0))

    def next_pick() -> float:
        action = task.expert_action()
        assert action is not None
        task.advance()
        return action.pick.y

    first, second = next_pick(), next_pick()
    assert first == pytest.approx(-second)
    assert (next_pick(), next_pick()) == pytest.approx((first, second))  # in turn, while nothing moves
    next_pick()
    task.expert_action()
    world.move_object(task.objects[0], PlanarPose(0.4, -0.1, 0.2).as_pose(HALF))
    task.advance()
    assert task.tries_in_vain(task.objects[0]) == task.tries_in_vain(task.objects[1]) == 0


def test_the_expert_keeps_the_fingers_out_of_neighbours(world: SimWorld) -> None:
    task = two_blocks(world)
    for dx in (-0.05, 0.05):  # walls beside the target, 1 cm from the block: jaws must close along y
        world.add(block_shape(), PlanarPose(0.5 + dx, -0.1, 0.0).as_pose(HALF), "gray", fixed=True)
    action = task.expert_action()
    assert action is not None
    assert abs(math.remainder(action.place.yaw - math.pi / 2, math.pi)) < 1e-6
    assert action.pick_yaw_period == pytest.approx(math.pi)


def add_until_full(world: SimWorld, rng: np.random.Generator) -> None:
    for _ in range(100):
        world.add(block_shape(), free_pose(world, block_shape(), rng).as_pose(HALF), "red")


def test_free_places_leave_room_for_fingers_and_end_in_an_error(world: SimWorld) -> None:
    rng = np.random.default_rng(3)
    spec = world.config.workspace
    with pytest.raises(LayoutError, match="no free place for another block"):
        add_until_full(world, rng)
    placed = list(world.objects)
    assert len(placed) >= 12
    spots = np.array([world.object_xy(o) for o in placed])
    gaps = np.linalg.norm(spots[:, None] - spots[None], axis=-1) + np.eye(len(spots))
    assert gaps.min() > HALF + block_shape().radius + FINGER_CLEARANCE - 0.004
    assert (spots > (spec.x_min + HALF, spec.y_min + HALF)).all()
    assert (spots < (spec.x_max - HALF, spec.y_max - HALF)).all()


def test_bowls_may_stand_closer_than_what_is_grasped(world: SimWorld) -> None:
    rng = np.random.default_rng(0)
    for _ in range(7):
        world.add(bowl_shape(), free_pose(world, bowl_shape(), rng, graspable=False).as_pose(0.0175), "red")
    spots = np.array([world.object_xy(bowl) for bowl in world.objects])
    gaps = np.linalg.norm(spots[:, None] - spots[None], axis=-1)[np.triu_indices(7, 1)] - 2 * bowl_shape().radius
    assert 0.0 < gaps.min() < FINGER_CLEARANCE


def test_a_container_is_hollow(world: SimWorld) -> None:
    at = PlanarPose(0.45, 0.0, 0.4).as_pose(0.025)
    world.add(container_shape(0.15, 0.12), at, fixed=True)
    cube = world.add(block_shape(), at @ Pose.from_xyz_rpy((0, 0, 0.03), (0, 0, 0)), "red")
    assert world.settle()
    assert world.object_pose(cube).translation[2] == pytest.approx(0.022, abs=2e-3)


def test_what_flies_off_is_an_error(world: SimWorld) -> None:
    cube = world.add(block_shape(), PlanarPose(0.45, 0.0, 0.0).as_pose(HALF), "red")
    world.move_object(cube, PlanarPose(30.0, 0.0, 0.0).as_pose(5.0))
    with pytest.raises(PhysicsError, match="the red block flew off"):
        world.settle()


@pytest.mark.parametrize("name", sorted(TASKS))
def test_every_task_sets_up_and_no_two_splits_share_a_scene(shared_world: SimWorld, name: str) -> None:
    draws = {float(scene_rng(name, split, 3).random()) for split in Split}
    assert len(draws) == len(Split)
    task = reset_scene(shared_world, name, "val", 3)
    assert task.name == name and task.objects and task.expert_action() is not None and task.score() < 0.99


@pytest.mark.parametrize(("alias", "name"), [("put-block-in-bowl-seen-colors", "put-blocks-in-bowls-seen-colors")])
def test_names_of_the_public_implementation_work(alias: str, name: str) -> None:
    assert make_task(alias, "test").name == name
