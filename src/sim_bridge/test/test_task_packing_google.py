"""packing-google-objects: scenes, splits, metric of single objects and of groups, and expert."""

from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cliport_core import Pose
from sim_bridge.errors import LayoutError, ObjectFolderError
from sim_bridge.everyday import FOLDER_VARIABLE, EverydayObject, object_set
from sim_bridge.geometry.mesh import TriangleMesh
from sim_bridge.objects import SceneObject, Shape
from sim_bridge.objects.block import WIDEST_PINCH
from sim_bridge.scene import reset_scene
from sim_bridge.task_mechanics import dropping
from sim_bridge.task_mechanics.goal import ZoneMetric
from sim_bridge.task_mechanics.placing import free_outline_pose
from sim_bridge.tasks.packing_google_objects import PackingGoogleObjects
from sim_bridge.world import SimWorld

SEQ = "packing-seen-google-objects-seq"
GROUP = "packing-seen-google-objects-group"
OUTSIDE = Pose(np.eye(3), np.array([0.5, 1.0, 0.1]))


@pytest.fixture(scope="module")
def world() -> Iterator[SimWorld]:
    world = SimWorld()
    yield world
    world.close()


@pytest.fixture(autouse=True)
def _own_set(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(FOLDER_VARIABLE, raising=False)


def scene(world: SimWorld, name: str, split: str = "val", seed: int = 5000) -> PackingGoogleObjects:
    task = reset_scene(world, name, split, seed)
    assert isinstance(task, PackingGoogleObjects)
    return task


def with_goals(world: SimWorld, least: int) -> PackingGoogleObjects:
    for seed in range(5000, 5020):
        task = scene(world, SEQ, seed=seed)
        if len(task.goals) >= least:
            return task
    raise AssertionError("no such scene")


def put(world: SimWorld, task: PackingGoogleObjects, thing: SceneObject, y: float = 0.0) -> None:
    """A thing upright in the container, its origin at `y` [m] from the middle."""
    container = task.goals[0].targets[0]
    world.move_object(thing, container @ Pose.from_xyz_rpy((0.0, y, 0.05), (0.0, 0.0, 0.0)))


def test_objects_are_packed_in_their_order(world: SimWorld) -> None:
    task = with_goals(world, 3)
    count = len(task.goals)
    things = [goal.objects[0] for goal in task.goals]
    assert task.max_steps == count + 1 and len({o.name for o in task.objects}) == len(task.objects)
    assert len([o for o in task.objects if not o.fixed]) > count
    for k, thing in enumerate(things):
        assert task.instruction == f"pack the {thing.name} in the brown box"
        assert task.score() == pytest.approx(k / count)
        put(world, task, thing)
        task.advance()
    assert task.score() == pytest.approx(1.0) and task.instruction == "done packing objects."


def test_a_later_object_first_advances_nothing(world: SimWorld) -> None:
    task = with_goals(world, 2)
    first, second = task.goals[0].objects[0], task.goals[1].objects[0]
    put(world, task, second)
    task.advance()
    assert task.score() == 0.0 and task.instruction.startswith(f"pack the {first.name} ")
    put(world, task, first, 0.001)
    task.advance()
    assert task.score() == pytest.approx(1 / len(task.goals))
    task.advance()
    assert task.score() == pytest.approx(2 / len(task.goals))  # the second lies there already


def test_a_goal_is_never_looked_at_again(world: SimWorld) -> None:
    task = with_goals(world, 2)
    first = task.goals[0].objects[0]
    put(world, task, first)
    task.advance()
    world.move_object(first, OUTSIDE)
    assert task.score() == pytest.approx(1 / len(task.goals))


def test_half_inside_is_its_share_of_points(world: SimWorld) -> None:
    task = scene(world, SEQ)
    goal = task.goals[0]
    assert isinstance(goal.metric, ZoneMetric)
    points = goal.metric.points[0]
    thing, depth = goal.objects[0], goal.metric.size[1]
    put(world, task, thing, depth / 2)
    inside = float((points[:, 1] < 0.0).mean())
    assert 0.0 < inside < 1.0
    assert task.score() == pytest.approx(inside * goal.max_reward)
    extent = np.ptp(thing.mesh.vertices, axis=0)
    assert len(points) == np.prod(np.ceil(extent / 0.02 - 1e-6))
    put(world, task, thing, depth)
    assert task.score() == 0.0


def test_a_group_is_all_objects_of_a_name(world: SimWorld) -> None:
    for seed in range(5000, 5003):
        task = scene(world, GROUP, seed=seed)
        (goal,) = task.goals
        count = Counter(o.name for o in task.objects if not o.fixed)
        wanted = goal.objects[0].name
        assert goal.sentence == f"pack all the {wanted} objects in the brown box"
        assert len(goal.objects) == count[wanted] >= 2 and task.max_steps == count[wanted] + 1
    points = [len(p) for p in goal.metric.points]  # type: ignore[union-attr]
    put(world, task, goal.objects[0])
    assert task.score() == pytest.approx(points[0] / sum(points))
    for thing in goal.objects[1:]:
        put(world, task, thing)
    assert task.score() == 1.0 and task.done() and task.instruction == "done packing objects."


@pytest.mark.parametrize("kind", ["seq", "group"])
def test_names_of_the_splits(world: SimWorld, kind: str) -> None:
    source = object_set()
    for split, allowed in (("train", source.seen), ("val", source.unseen), ("test", source.unseen)):
        task = scene(world, f"packing-unseen-google-objects-{kind}", split)
        assert task.names == allowed
        assert {o.name for o in task.objects if not o.fixed} <= set(allowed)
    assert set(scene(world, SEQ, "train").names) == {*source.seen, *source.unseen}


def test_everything_rests_apart_inside_and_can_be_held(world: SimWorld) -> None:
    spec = world.config.workspace
    for seed in (5001, 5002):
        task = scene(world, SEQ, seed=seed)
        at = {}
        for thing in task.objects:
            corners = world.object_pose(thing).apply(thing.mesh.vertices)
            assert (corners[:, :2] > (spec.x_min, spec.y_min)).all(), thing.name
            assert (corners[:, :2] < (spec.x_max, spec.y_max)).all(), thing.name
            if not thing.fixed:
                assert corners[:, 2].min() == pytest.approx(0.0, abs=0.008), thing.name
                pinches = task.pinches(thing)
                assert pinches and all(p.width <= WIDEST_PINCH for p in pinches), thing.name
                at[thing] = world.object_xy(thing)
        for _ in range(120):
            world.step()
        assert all(np.linalg.norm(world.object_xy(o) - xy) < 0.004 for o, xy in at.items())


def test_same_seed_same_scene(world: SimWorld) -> None:
    def look() -> list[tuple[str, list[float]]]:
        task = scene(world, GROUP, seed=5004)
        return [(o.described, world.object_pose(o).as_matrix().ravel().tolist()) for o in task.objects]

    assert look() == look()


def test_expert_goes_beside_what_lies_in_the_middle(world: SimWorld) -> None:
    task = with_goals(world, 2)
    goal = task.goals[0]
    first = task.expert_action()
    assert first is not None and task.instruction == goal.sentence
    choice = task.judge(first.pick, first.place)
    assert choice.picked == goal.objects[0].name and choice.pick_right and choice.place_right
    put(world, task, goal.objects[0])
    world.settle()
    task.advance()
    following = task.expert_action()
    assert following is not None
    middle = goal.targets[0].translation[:2]
    assert np.hypot(following.place.x - middle[0], following.place.y - middle[1]) > 0.03
    assert task.judge(following.pick, following.place).place_right


def test_a_missing_folder_ends_in_one_line(world: SimWorld, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv(FOLDER_VARIABLE, str(tmp_path / "nothing"))
    with pytest.raises(ObjectFolderError, match="is no folder"):
        reset_scene(world, SEQ, "val", 0)


def test_a_thing_that_cannot_be_held_as_it_lies_is_left_out_and_the_next_are_not(
    world: SimWorld, monkeypatch: pytest.MonkeyPatch
) -> None:
    holdable, tried = dropping._holdable, []

    def all_but_the_first(thing: EverydayObject, *how: object) -> object:
        tried.append(thing.name)
        return None if len(tried) == 1 else holdable(thing, *how)  # type: ignore[arg-type]

    monkeypatch.setattr(dropping, "_holdable", all_but_the_first)
    world.clear()
    source = object_set()
    names = source.seen[:3]
    things = dropping.drop(world, [(source.named(name), 0.12) for name in names], np.random.default_rng(0))
    assert tuple(tried) == tuple(names)
    assert [thing.shape.name for thing in things] == list(names[1:])


def test_the_largest_size_that_the_hand_can_hold_is_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    thing, tried = object_set().named(object_set().seen[0]), []

    def only_three_fifths(shape: Shape, *how: object) -> list[str]:
        tried.append(float(np.ptp(shape.mesh.vertices, axis=0).max()))
        return ["a pinch"] if len(tried) == 8 else []

    monkeypatch.setattr(dropping, "pinches_lying", only_three_fifths)
    held = dropping._holdable(thing, 0.12, Pose(np.eye(3), np.zeros(3)))
    assert held is not None and len(held[1]) == 1
    np.testing.assert_allclose(np.array(tried) / tried[0], [1.0, 0.85, 0.72, 0.61] * 2, rtol=1e-6)


def test_an_outline_without_room_is_named_with_its_size_and_the_table(world: SimWorld) -> None:
    world.clear()
    shape = object_set().named(object_set().seen[0]).sized(0.12)
    flat = replace(shape, mesh=TriangleMesh.box((0.8, 1.8, 0.02)))
    with pytest.raises(LayoutError) as raised:
        free_outline_pose(world, flat, np.random.default_rng(0), 0.01)
    assert str(raised.value) == (
        f"no free place for another {shape.name} (800 mm x 1800 mm) beside 0 things on 0.40 m x 0.80 m; "
        "use a larger workspace"
    )
