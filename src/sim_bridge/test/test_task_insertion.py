"""block-insertion, align-box-corner and place-red-in-green: make-up, sentences, metric and expert."""

import math
from collections.abc import Iterator

import numpy as np
import pytest

from cliport_core import Pose
from sim_bridge.objects import SceneObject
from sim_bridge.scene import reset_scene
from sim_bridge.task_mechanics.goal_task import GoalTask
from sim_bridge.tasks.place_red_in_green import PlaceRedInGreen
from sim_bridge.world import SimWorld

TOLERANCES = [
    (0.0, 0.0, True),
    (0.0099, 0.0, True),
    (0.0101, 0.0, False),
    (0.0, math.radians(14.5), True),
    (0.0, math.radians(-15.5), False),
]


@pytest.fixture(scope="module")
def world() -> Iterator[SimWorld]:
    world = SimWorld()
    yield world
    world.close()


def set_up(world: SimWorld, name: str, seed: int) -> GoalTask:
    task = reset_scene(world, name, "val", seed)
    assert isinstance(task, GoalTask)
    return task


def put(world: SimWorld, thing: SceneObject, target: Pose, off: float = 0.0, turned: float = 0.0) -> None:
    world.move_object(thing, target @ Pose.from_xyz_rpy((off, 0.0, 0.0), (0.0, 0.0, turned)))


@pytest.mark.parametrize("name", ["block-insertion", "align-box-corner"])
@pytest.mark.parametrize(("off", "turned", "right"), TOLERANCES)
def test_all_or_nothing_within_the_tolerance(
    world: SimWorld, name: str, off: float, turned: float, right: bool
) -> None:
    task = set_up(world, name, 5000)
    goal = task.goals[0]
    assert task.max_steps == 3 and len(task.goals) == 1 and task.score() == 0.0
    put(world, goal.objects[0], goal.targets[0], off, turned)
    assert task.score() == (1.0 if right else 0.0) and task.done() is right


@pytest.mark.parametrize("turned", [math.pi / 2, math.pi, -math.pi / 2])
def test_an_l_block_fits_only_one_way_round(world: SimWorld, turned: float) -> None:
    task = set_up(world, "block-insertion", 5001)
    goal = task.goals[0]
    put(world, goal.objects[0], goal.targets[0], turned=turned)
    assert task.score() == 0.0


def test_the_l_block_rests_inside_the_fixture(world: SimWorld) -> None:
    task = set_up(world, "block-insertion", 5002)
    assert task.instruction == "put the L shape block in the L shape hole"
    fixture, block = task.objects
    assert fixture.fixed and (fixture.name, block.name) == ("L fixture", "L block")
    target = task.goals[0].targets[0]
    put(world, block, target @ Pose.from_xyz_rpy((0.007, -0.007, 0.002), (0.0, 0.0, 0.0)))
    assert world.settle() and task.score() == 1.0
    assert world.object_pose(block).translation[2] == pytest.approx(target.translation[2], abs=1e-3)


def test_a_box_fits_its_corner_in_four_ways_with_a_corner_in_the_mark(world: SimWorld) -> None:
    for seed in range(5000, 5006):
        task = set_up(world, "align-box-corner", seed)
        assert task.instruction == "align the brown box with the green corner"
        mark, box = task.objects
        x, y, _ = np.ptp(box.mesh.vertices, axis=0)
        assert min(x, y) <= 0.072 and 0.05 <= x <= 0.15 and 0.05 <= y <= 0.15
        assert mark.shape.collision is None and len(task.goals[0].targets) == 4
        for target in task.goals[0].targets:
            put(world, box, target)
            assert task.score() == 1.0
            local = (world.object_pose(mark).inverse() @ world.object_pose(box)).apply(box.mesh.vertices)
            assert np.allclose(local[:, :2].max(axis=0), (x / 2, y / 2), atol=1e-6)


def test_boxes_differ_in_size_and_shade(world: SimWorld) -> None:
    boxes = [set_up(world, "align-box-corner", seed).objects[1] for seed in range(6)]
    assert len({box.rgb for box in boxes}) == 6
    assert len({tuple(np.ptp(box.mesh.vertices, axis=0)) for box in boxes}) == 6


def test_red_blocks_count_in_any_green_bowl(world: SimWorld) -> None:
    for seed in range(5000, 5040):
        task = set_up(world, "place-red-in-green", seed)
        assert isinstance(task, PlaceRedInGreen)
        blocks, bowls = task.blocks("red"), task.bowls("green")
        if len(blocks) == 2:
            break
    assert task.instruction == "put the red blocks in a green bowl" and task.max_steps == 10
    targets = [b for b in bowls if b.fixed]
    put(world, blocks[0], world.object_pose(targets[0]), off=0.0501)
    assert task.score() == 0.0
    put(world, blocks[0], world.object_pose(targets[0]), off=0.0499)
    assert task.score() == 0.5
    put(world, blocks[1], world.object_pose(targets[0]), off=-0.03)
    assert task.score() == 1.0 and task.done()


def test_distractors_are_any_blocks_but_red_and_any_bowls_but_green(world: SimWorld) -> None:
    green_blocks = red_bowls = 0
    for seed in range(12):
        task = set_up(world, "place-red-in-green", seed)
        assert isinstance(task, PlaceRedInGreen)
        n_red, n_green = len(task.blocks("red")), len(task.bowls("green"))
        assert 1 <= n_red <= n_green <= 3 and all(bowl.fixed for bowl in task.bowls("green"))
        assert len(task.objects) == n_red + n_green + 6
        green_blocks += len(task.blocks("green"))
        red_bowls += len(task.bowls("red"))
    assert green_blocks > 0 and red_bowls > 0


@pytest.mark.parametrize("name", ["block-insertion", "align-box-corner", "place-red-in-green"])
def test_every_scene_sets_up_the_same_again_and_has_something_to_do(world: SimWorld, name: str) -> None:
    def scene(seed: int) -> list[tuple[str, tuple[float, ...]]]:
        task = set_up(world, name, seed)
        assert task.expert_action() is not None
        return [(o.described, tuple(world.object_pose(o).translation)) for o in task.objects]

    assert all(scene(seed) == scene(seed) for seed in range(5))
