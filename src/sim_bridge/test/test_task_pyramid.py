"""stack-block-pyramid, block by block and row by row: make-up, sentences, metric, order and expert."""

import math
from collections.abc import Iterator

import pytest

from cliport_core import Pose
from sim_bridge.colors import SEEN_PALETTE, UNSEEN_PALETTE
from sim_bridge.objects import SceneObject
from sim_bridge.scene import reset_scene
from sim_bridge.tasks.stack_block_pyramid import StackBlockPyramid, StackBlockPyramidSeq
from sim_bridge.world import SimWorld

SEQ = "stack-block-pyramid-seq-seen-colors"
ROWS = "stack-block-pyramid"


@pytest.fixture(scope="module")
def world() -> Iterator[SimWorld]:
    world = SimWorld()
    yield world
    world.close()


def put(world: SimWorld, thing: SceneObject, target: Pose, off: float = 0.0, turned: float = 0.0) -> None:
    world.move_object(thing, target @ Pose.from_xyz_rpy((off, 0.0, 0.0), (0.0, 0.0, turned)))


def test_each_block_counts_when_it_is_put_on_in_its_turn(world: SimWorld) -> None:
    task = reset_scene(world, SEQ, "val", 5000)
    assert isinstance(task, StackBlockPyramidSeq) and task.max_steps == 12
    colors = [goal.objects[0].color for goal in task.goals]
    places = [
        "the lightest brown block",
        "the middle brown block",
        "the darkest brown block",
        f"the {colors[0]} and {colors[1]} blocks",
        f"the {colors[1]} and {colors[2]} blocks",
        f"the {colors[3]} and {colors[4]} blocks",
    ]
    for i, (goal, place) in enumerate(zip(task.goals, places, strict=True)):
        assert task.instruction == f"put the {colors[i]} block on {place}"
        assert task.score() == pytest.approx(i / 6)
        put(world, goal.objects[0], goal.targets[0])
        task.advance()
        assert task.score() == pytest.approx((i + 1) / 6)
    assert task.done() and task.instruction == "done stacking block pyramid." and task.expert_action() is None


def test_a_pyramid_built_by_hand_stands_where_the_goals_say(world: SimWorld) -> None:
    task = reset_scene(world, SEQ, "val", 5001)
    assert isinstance(task, StackBlockPyramidSeq)
    for goal in task.goals:
        put(world, goal.objects[0], goal.targets[0])
    assert world.settle()
    for goal in task.goals:
        at = world.object_pose(goal.objects[0])
        assert at.is_close(goal.targets[0], tolerance=1e-3)


def test_block_put_on_out_of_turn_does_not_count_until_its_turn_comes(world: SimWorld) -> None:
    task = reset_scene(world, SEQ, "val", 5002)
    assert isinstance(task, StackBlockPyramidSeq)
    first, second = task.goals[:2]
    put(world, second.objects[0], second.targets[0])
    task.advance()
    assert task.score() == 0.0 and task.present_goal is first
    put(world, first.objects[0], first.targets[0])
    task.advance()
    assert task.score() == pytest.approx(1 / 6) and task.present_goal is second
    task.advance()
    assert task.score() == pytest.approx(2 / 6)


@pytest.mark.parametrize(
    ("off", "turned", "right"),
    [
        (0.0099, 0.0, True),
        (0.0101, 0.0, False),
        (0.0, math.radians(14.5), True),
        (0.0, math.radians(15.5), False),
        (0.0, math.pi / 2, True),
    ],
)
def test_tolerances(world: SimWorld, off: float, turned: float, right: bool) -> None:
    task = reset_scene(world, SEQ, "val", 5003)
    assert isinstance(task, StackBlockPyramidSeq)
    put(world, task.goals[0].objects[0], task.goals[0].targets[0], off, turned)
    assert task.score() == pytest.approx(1 / 6 if right else 0.0)


@pytest.mark.parametrize(
    ("name", "split", "palette"),
    [
        (SEQ, "train", SEEN_PALETTE),
        (SEQ, "test", SEEN_PALETTE),
        ("stack-block-pyramid-seq-unseen-colors", "train", SEEN_PALETTE),
        ("stack-block-pyramid-seq-unseen-colors", "val", UNSEEN_PALETTE),
        ("stack-block-pyramid-seq-unseen-colors", "test", UNSEEN_PALETTE),
    ],
)
def test_six_colours_of_the_splits_palette(world: SimWorld, name: str, split: str, palette: tuple[str, ...]) -> None:
    seen = set()
    for seed in range(8):
        task = reset_scene(world, name, split, seed)
        stand, *blocks = task.objects
        assert stand.name == "stand" and stand.fixed
        colors = [block.color for block in blocks]
        assert len(set(colors)) == 6 and set(colors) <= set(palette)
        seen |= set(colors)
    assert seen == set(palette)


def test_rows_are_worth_their_blocks_which_are_interchangeable(world: SimWorld) -> None:
    task = reset_scene(world, ROWS, "val", 5000)
    assert isinstance(task, StackBlockPyramid) and task.max_steps == 12
    bottom, middle, top = task.goals
    assert [goal.sentence for goal in task.goals] == [
        "make the bottom row with the green, blue and purple blocks",
        "make the middle row with the yellow and orange blocks",
        "make the top row with the red block",
    ]
    assert {o.color for o in bottom.objects} == {"green", "blue", "purple"}
    for i, (block, target) in enumerate(zip(bottom.objects, reversed(bottom.targets), strict=True)):
        assert task.score() == pytest.approx(i / 6)
        put(world, block, target)
    task.advance()
    assert task.present_goal is middle
    put(world, middle.objects[0], middle.targets[1])
    assert task.score() == pytest.approx(3 / 6) and task.running_score() == pytest.approx(4 / 6)
    put(world, middle.objects[1], middle.targets[0], off=0.011)
    task.advance()
    assert task.score() == pytest.approx(4 / 6) and task.present_goal is middle
    put(world, middle.objects[1], middle.targets[0])
    task.advance()
    put(world, top.objects[0], top.targets[0])
    task.advance()
    assert task.score() == pytest.approx(1.0) and task.done()


def test_expert_closes_its_jaws_across_the_row_beside_a_neighbour(world: SimWorld) -> None:
    for seed in range(5000, 5006):
        task = reset_scene(world, SEQ, "val", seed)
        assert isinstance(task, StackBlockPyramidSeq)
        for i, goal in enumerate(task.goals):
            action = task.expert_action()
            assert action is not None
            slot = goal.targets[0].translation
            assert (action.place.x, action.place.y) == pytest.approx((slot[0], slot[1]), abs=1e-3)
            if i in (1, 2, 4):  # beside a block that lies already
                stand_yaw = world.object_yaw(task.objects[0])
                assert abs(math.remainder(action.place.yaw - stand_yaw, math.pi)) < 1e-3
            put(world, goal.objects[0], goal.targets[0])
            task.advance()


@pytest.mark.parametrize("name", [SEQ, ROWS])
def test_the_same_seed_is_the_same_scene(world: SimWorld, name: str) -> None:
    def scene() -> list[tuple[str, tuple[float, ...]]]:
        task = reset_scene(world, name, "val", 7)
        return [(o.described, tuple(world.object_pose(o).translation)) for o in task.objects]

    assert scene() == scene()
