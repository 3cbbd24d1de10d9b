"""packing-box-pairs and packing-boxes: scenes, sentences, metric and expert."""

import re
from collections.abc import Iterator

import numpy as np
import pytest

from cliport_core import Pose
from sim_bridge.colors import SEEN_PALETTE, UNSEEN_PALETTE
from sim_bridge.objects import SceneObject
from sim_bridge.scene import reset_scene
from sim_bridge.task_mechanics.goal import ZoneMetric
from sim_bridge.tasks.packing_boxes import PackingBoxes
from sim_bridge.world import SimWorld

SEEN = "packing-box-pairs-seen-colors"
UNSEEN = "packing-box-pairs-unseen-colors"


@pytest.fixture(scope="module")
def world() -> Iterator[SimWorld]:
    world = SimWorld()
    yield world
    world.close()


def scene(world: SimWorld, name: str, split: str, seed: int) -> PackingBoxes:
    task = reset_scene(world, name, split, seed)
    assert isinstance(task, PackingBoxes)
    return task


def with_boxes(world: SimWorld, name: str, least: int) -> PackingBoxes:
    for seed in range(5000, 5040):
        task = scene(world, name, "val", seed)
        if len(task.goals[0].objects) >= least:
            return task
    raise AssertionError("no such scene")


def pack(world: SimWorld, task: PackingBoxes, boxes: tuple[SceneObject, ...] | None = None) -> None:
    goal = task.goals[0]
    for box, target in zip(goal.objects, goal.targets, strict=True):
        if boxes is None or box in boxes:
            world.move_object(box, target @ Pose(np.eye(3), np.array([0.0, 0.0, 0.0005])))


@pytest.mark.parametrize("name", [SEEN, "packing-boxes"])
def test_every_box_in_its_cell_is_the_whole_task(world: SimWorld, name: str) -> None:
    task = with_boxes(world, name, 4)
    assert task.score() == 0.0 and task.instruction == task.sentence and task.max_steps == 20
    pack(world, task)
    assert world.settle()
    assert task.score() == 1.0 and task.done() and task.expert_action() is None
    task.advance()
    assert task.instruction == ("done packing blocks." if name == SEEN else "done packing boxes.")


def test_score_is_the_share_of_points_inside(world: SimWorld) -> None:
    task = with_boxes(world, SEEN, 4)
    goal = task.goals[0]
    assert isinstance(goal.metric, ZoneMetric)
    sizes = np.array([len(points) for points in goal.metric.points])
    pack(world, task, goal.objects[:2])
    assert task.score() == pytest.approx(sizes[:2].sum() / sizes.sum())
    # half over the edge: of its points every 20 mm those that are inside
    box, metric = goal.objects[2], goal.metric
    assert metric.about is not None
    depth = metric.size[1]
    world.move_object(box, metric.about @ Pose.from_xyz_rpy((0.0, depth / 2, 0.03), (0.0, 0.0, 0.0)))
    y = metric.points[2][:, 1]
    assert task.score() == pytest.approx((sizes[:2].sum() + (y < 0).sum()) / sizes.sum())
    world.move_object(box, metric.about @ Pose.from_xyz_rpy((0.0, depth, 0.03), (0.0, 0.0, 0.0)))
    assert task.score() == pytest.approx(sizes[:2].sum() / sizes.sum())


@pytest.mark.parametrize(("name", "cap"), [(SEEN, 0.0775), ("packing-boxes", 0.105)])
def test_points_above_the_cap_do_not_count(world: SimWorld, name: str, cap: float) -> None:
    task = with_boxes(world, name, 2)
    goal = task.goals[0]
    pack(world, task)
    box, target = goal.objects[0], goal.targets[0]
    world.move_object(box, Pose(target.rotation, (*target.translation[:2], cap + 0.024)))  # its underside under the cap
    assert isinstance(goal.metric, ZoneMetric)
    first, total = len(goal.metric.points[0]), sum(len(points) for points in goal.metric.points)
    assert task.score() == pytest.approx((total - 2 * first / 3) / total)  # two of its three layers are above it


def test_distractors_do_not_count_and_lie_outside(world: SimWorld) -> None:
    task = with_boxes(world, SEEN, 3)
    goal = task.goals[0]
    others = [o for o in task.objects if not o.fixed and o not in goal.objects]
    assert 0 < len(others) <= 4
    assert not {o.color for o in goal.objects} & {o.color for o in others}
    for other in others:
        world.move_object(other, Pose(np.eye(3), goal.targets[0].translation))
    assert task.score() == 0.0


@pytest.mark.parametrize(
    ("name", "split", "palette"),
    [(SEEN, "test", SEEN_PALETTE), (UNSEEN, "train", SEEN_PALETTE), (UNSEEN, "test", UNSEEN_PALETTE)],
)
def test_colours_and_sentences(world: SimWorld, name: str, split: str, palette: tuple[str, ...]) -> None:
    for seed in range(8):
        task = scene(world, name, split, seed)
        goal = task.goals[0]
        assert {o.color for o in task.objects if not o.fixed} <= set(palette)
        one = re.fullmatch(r"pack all the (\w+) blocks into the brown box", goal.sentence)
        two = re.fullmatch(r"pack all the (\w+) and (\w+) blocks into the brown box", goal.sentence)
        assert bool(one) == (len(goal.objects) == 1) and bool(two) != bool(one)
        found = one or two
        assert found is not None and {o.color for o in goal.objects} <= set(found.groups())


def test_packing_boxes_has_no_distractors_and_no_brown_box(world: SimWorld) -> None:
    for seed in range(8):
        task = scene(world, "packing-boxes", "test", seed)
        boxes = [o for o in task.objects if not o.fixed]
        assert tuple(boxes) == task.goals[0].objects
        assert "brown" not in {box.color for box in boxes}
        assert task.instruction == "pack all the boxes inside the brown box"


def test_every_box_can_be_held_and_lies_inside_the_workspace(world: SimWorld) -> None:
    for seed in range(5000, 5006):
        task = scene(world, SEEN, "val", seed)
        for thing in task.objects:
            assert thing.fixed or thing.shape.pinches
            corners = world.object_pose(thing).apply(thing.mesh.vertices)[:, :2]
            spec = world.config.workspace
            assert (corners > (spec.x_min, spec.y_min)).all() and (corners < (spec.x_max, spec.y_max)).all()


def test_same_seed_same_scene(world: SimWorld) -> None:
    def look() -> list[tuple[str, list[float]]]:
        task = scene(world, UNSEEN, "val", 5003)
        return [(o.described, world.object_pose(o).as_matrix().ravel().tolist()) for o in task.objects]

    assert look() == look()


def test_expert_brings_the_farthest_box_to_its_cell(world: SimWorld) -> None:
    task = with_boxes(world, SEEN, 3)
    goal, action = task.goals[0], task.expert_action()
    assert action is not None and task.instruction == goal.sentence
    away = [np.linalg.norm(world.object_xy(o) - t.translation[:2]) for o, t in zip(goal.objects, goal.targets)]
    target = goal.targets[int(np.argmax(away))]
    assert (action.place.x, action.place.y) == pytest.approx(tuple(target.translation[:2]), abs=1e-6)
    choice = task.judge(action.pick, action.place)
    assert choice.pick_right and choice.place_right
