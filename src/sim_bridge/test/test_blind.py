"""The agent without words: what it may move where, in every task."""

from collections.abc import Iterator

import numpy as np
import pytest

from cliport_core import Primitive
from sim_bridge.scene import reset_scene
from sim_bridge.task_mechanics.blind import BlindChooser
from sim_bridge.task_mechanics.goal_task import GoalTask
from sim_bridge.tasks import DEMO_TASKS, LANGUAGE_SPLITS
from sim_bridge.world import SimWorld


@pytest.fixture(scope="module")
def world() -> Iterator[SimWorld]:
    world = SimWorld()
    yield world
    world.close()


@pytest.mark.parametrize("name", [*LANGUAGE_SPLITS, *DEMO_TASKS])
def test_every_task_offers_something_to_an_agent_without_words(world: SimWorld, name: str) -> None:
    task = reset_scene(world, name, "test", 5)
    first, again = (BlindChooser(task, world, np.random.default_rng(3)).action() for _ in range(2))
    assert first is not None and first == again
    assert first.primitive is task.primitive


def picks(world: SimWorld, task: GoalTask, draws: int) -> set[str]:
    """Count the first picks over many draws."""
    chooser = BlindChooser(task, world, np.random.default_rng(0))
    actions = [chooser.action() for _ in range(draws)]
    return {task.judge(action.pick, action.place).picked for action in actions if action is not None}


def test_any_shape_may_go_into_the_box_but_none_that_lies_there(world: SimWorld) -> None:
    task = reset_scene(world, "packing-unseen-shapes", "test", 0)
    assert isinstance(task, GoalTask)
    shapes = [thing for thing in task.objects if not thing.fixed]
    assert picks(world, task, 60) == {shape.described for shape in shapes}
    world.move_object(shapes[0], task.goals[0].targets[0])
    assert picks(world, task, 60) == {shape.described for shape in shapes[1:]}


def test_only_the_top_ring_of_a_peg_is_moved(world: SimWorld) -> None:
    task = reset_scene(world, "towers-of-hanoi-seq-seen-colors", "test", 0)
    assert isinstance(task, GoalTask)
    assert picks(world, task, 20) == {task.goals[0].objects[0].described}


def test_upper_blocks_wait_for_those_beneath(world: SimWorld) -> None:
    task = reset_scene(world, "stack-block-pyramid-seq-seen-colors", "test", 0)
    assert isinstance(task, GoalTask)
    blocks = [goal.objects[0] for goal in task.goals]
    assert picks(world, task, 60) == {block.described for block in blocks[:3]}
    for goal in task.goals[:2]:
        world.move_object(goal.objects[0], goal.targets[0])
    assert picks(world, task, 60) == {blocks[2].described, blocks[3].described}


def test_a_drag_keeps_to_one_guess(world: SimWorld) -> None:
    task = reset_scene(world, "separating-piles-seen-colors", "test", 0)
    assert task.primitive is Primitive.SWEEP and len(task.goals_without_words()) == 2
    places = set()
    for seed in range(8):
        chooser = BlindChooser(task, world, np.random.default_rng(seed))
        first, again = chooser.action(), chooser.action()
        assert first is not None and first == again
        places.add((first.place.x, first.place.y))
    assert len(places) == 2
