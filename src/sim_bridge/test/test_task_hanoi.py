"""towers-of-hanoi, a sentence a move and one for all: make-up, sentences, metric, order and expert."""

import math
from collections.abc import Iterator

import numpy as np
import pytest

from cliport_core import Pose
from sim_bridge.colors import SEEN_PALETTE, UNSEEN_PALETTE
from sim_bridge.objects.hanoi import RING_DIAMETERS, ring_shape
from sim_bridge.scene import reset_scene
from sim_bridge.task_mechanics.goal import Goal
from sim_bridge.task_mechanics.goal_task import GoalTask
from sim_bridge.world import SimWorld

SEQ = "towers-of-hanoi-seq-seen-colors"
PLAIN = "towers-of-hanoi"
PEG_NAMES = ("lighter brown side", "middle of the stand", "darker brown side")
MOVES = ((0, 2), (1, 1), (0, 1), (2, 2), (0, 0), (1, 2), (0, 2))


@pytest.fixture(scope="module")
def world() -> Iterator[SimWorld]:
    world = SimWorld()
    yield world
    world.close()


def set_up(world: SimWorld, name: str = SEQ, seed: int = 5000) -> GoalTask:
    task = reset_scene(world, name, "val", seed)
    assert isinstance(task, GoalTask)
    return task


def put(world: SimWorld, goal: Goal, off: float = 0.0) -> None:
    world.move_object(goal.objects[0], goal.targets[0] @ Pose.from_xyz_rpy((off, 0.0, 0.0), (0.0, 0.0, 0.4)))


def test_rings_start_on_the_lighter_side_the_largest_lowest(world: SimWorld) -> None:
    task = set_up(world)
    stand, *rings = task.objects
    assert stand.fixed and [ring.shape for ring in rings] == [ring_shape(d) for d in RING_DIAMETERS]
    local = [world.object_pose(stand).inverse().apply(world.object_pose(r).translation) for r in rings]
    assert np.allclose([at[:2] for at in local], [(0.0, -0.12)] * 3, atol=1e-3)
    assert local[0][2] > local[1][2] + 0.019 and local[1][2] > local[2][2] + 0.019


def test_every_ring_is_threaded_on_the_peg_at_the_start(world: SimWorld) -> None:
    task = set_up(world)
    stand, *rings = task.objects
    peg_top = world.object_pose(stand).apply(stand.mesh.vertices)[:, 2].max()
    for ring in rings:
        underside = world.object_pose(ring).apply(ring.mesh.vertices)[:, 2].min()
        assert underside < peg_top - 0.003


@pytest.mark.parametrize("name", [SEQ, PLAIN])
def test_seven_moves_each_a_seventh(world: SimWorld, name: str) -> None:
    task = set_up(world, name)
    rings = task.objects[1:]
    assert task.max_steps == 14 and len(task.goals) == len(MOVES)
    for i, (goal, (ring, peg)) in enumerate(zip(task.goals, MOVES, strict=True)):
        move = f"move the {rings[ring].color} ring to the {PEG_NAMES[peg]}"
        assert task.instruction == (move if name == SEQ else "solve towers of hanoi")
        assert goal.objects == (rings[ring],) and task.score() == pytest.approx(i / 7)
        put(world, goal)
        task.advance()
    assert task.score() == pytest.approx(1.0) and task.done() and task.instruction == "solved towers of hanoi."


def test_every_move_rests_where_its_goal_says(world: SimWorld) -> None:
    task = set_up(world, seed=5001)
    for goal in task.goals:
        put(world, goal)
        assert world.settle()
        at = world.object_pose(goal.objects[0])
        assert np.allclose(at.translation, goal.targets[0].translation, atol=1e-3) and at.rotation[2, 2] > 0.999
        task.advance()


def test_tolerance_is_a_centimetre_and_no_yaw(world: SimWorld) -> None:
    task = set_up(world, seed=5002)
    put(world, task.goals[0], off=0.0101)
    assert task.score() == 0.0
    put(world, task.goals[0], off=0.0099)
    assert task.score() == pytest.approx(1 / 7)


def test_a_move_out_of_turn_does_not_count(world: SimWorld) -> None:
    task = set_up(world, seed=5003)
    put(world, task.goals[1])
    task.advance()
    assert task.score() == 0.0 and task.present_goal is task.goals[0]
    assert task.instruction == task.goals[0].sentence


def test_a_ring_falls_around_its_peg(world: SimWorld) -> None:
    task = set_up(world, seed=5004)
    ring, target = task.goals[0].objects[0], task.goals[0].targets[0]
    world.move_object(ring, target @ Pose.from_xyz_rpy((0.006, 0.0, 0.03), (0.0, 0.0, 0.0)))
    world.settle()
    assert world.object_pose(ring).translation[2] == pytest.approx(target.translation[2], abs=1e-3)


@pytest.mark.parametrize(
    ("name", "split", "palette"),
    [
        (SEQ, "train", SEEN_PALETTE),
        (SEQ, "test", SEEN_PALETTE),
        ("towers-of-hanoi-seq-unseen-colors", "train", SEEN_PALETTE),
        ("towers-of-hanoi-seq-unseen-colors", "val", UNSEEN_PALETTE),
        ("towers-of-hanoi-seq-unseen-colors", "test", UNSEEN_PALETTE),
    ],
)
def test_three_colours_of_the_splits_palette(world: SimWorld, name: str, split: str, palette: tuple[str, ...]) -> None:
    seen = set()
    for seed in range(5):
        task = reset_scene(world, name, split, seed)
        colors = [ring.color for ring in task.objects[1:]]
        assert len(set(colors)) == 3 and set(colors) <= set(palette)
        seen |= set(colors)
    assert len(seen) > 3


def test_without_colours_in_the_sentence_they_are_always_the_same(world: SimWorld) -> None:
    assert [ring.color for ring in set_up(world, PLAIN).objects[1:]] == ["red", "yellow", "green"]


def test_expert_takes_rings_by_their_middle_across_the_stand(world: SimWorld) -> None:
    task = set_up(world, seed=5005)
    yaw = world.object_yaw(task.objects[0])
    for goal in task.goals:
        action = task.expert_action()
        assert action is not None
        assert np.allclose((action.pick.x, action.pick.y), world.object_xy(goal.objects[0]))
        assert np.allclose((action.place.x, action.place.y), goal.targets[0].translation[:2])
        assert abs(math.remainder(action.pick.yaw - yaw, math.pi)) < 0.01
        assert action.place.yaw == action.pick.yaw
        world.move_object(goal.objects[0], goal.targets[0])
        task.advance()


def test_the_stand_lies_inside_the_workspace(world: SimWorld) -> None:
    spec = world.config.workspace
    for seed in range(5000, 5008):
        stand = set_up(world, seed=seed).objects[0]
        corners = world.object_pose(stand).apply(stand.mesh.vertices)
        assert spec.x_min < corners[:, 0].min() and corners[:, 0].max() < spec.x_max
        assert spec.y_min < corners[:, 1].min() and corners[:, 1].max() < spec.y_max
