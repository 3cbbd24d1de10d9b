"""assembling-kits-seq and assembling-kits: scenes, sentences, metric and expert."""

import math
from collections import Counter
from collections.abc import Iterator

import numpy as np
import pytest

from cliport_core import PickPlaceAction, PlanarPose, Pose, WorkspaceSpec
from sim_bridge.colors import COLORS, SEEN_PALETTE, UNSEEN_PALETTE
from sim_bridge.errors import LayoutError
from sim_bridge.objects import SceneObject
from sim_bridge.objects.kit import KIT_SIZE
from sim_bridge.objects.kit_shapes import KIT_SHAPES, SEEN_SHAPES, THICKNESS, UNSEEN_SHAPES
from sim_bridge.scene import reset_scene
from sim_bridge.task_mechanics.goal import Goal
from sim_bridge.task_mechanics.placing import outline
from sim_bridge.tasks.assembling_kits_seq import which_of
from sim_bridge.tasks.kit_task import KitTask
from sim_bridge.world import SimConfig, SimWorld

SEQ = "assembling-kits-seq-seen-colors"
SEQ_UNSEEN = "assembling-kits-seq-unseen-colors"
SEQ_FULL = "assembling-kits-seq-full"
ANY = "assembling-kits"
SEEN_NAMES = {KIT_SHAPES[i].name for i in SEEN_SHAPES}
UNSEEN_NAMES = {KIT_SHAPES[i].name for i in UNSEEN_SHAPES}


@pytest.fixture(scope="module")
def world() -> Iterator[SimWorld]:
    world = SimWorld()
    yield world
    world.close()


def reset(world: SimWorld, name: str, split: str, seed: int) -> KitTask:
    task = reset_scene(world, name, split, seed)
    assert isinstance(task, KitTask)
    return task


def loose(task: KitTask) -> list[SceneObject]:
    return [thing for thing in task.objects if not thing.fixed]


def put(world: SimWorld, thing: SceneObject, target: Pose, off: float = 0.0, turn: float = 0.0) -> None:
    at = PlanarPose.from_pose(target)
    pose = PlanarPose(at.x + off * math.cos(1.0), at.y + off * math.sin(1.0), at.yaw + turn)
    world.move_object(thing, pose.as_pose(KIT_SIZE[2] + THICKNESS / 2))


@pytest.mark.parametrize("seed", range(5))
def test_each_shape_in_its_print_in_the_sentences_order_is_worth_a_fifth(world: SimWorld, seed: int) -> None:
    task = reset(world, SEQ, "test", seed)
    assert task.max_steps == 5 and len(task.goals) == 5
    for i, goal in enumerate(task.goals):
        assert task.present_goal is goal and task.score() == pytest.approx(i / 5)
        assert task.instruction == goal.sentence
        put(world, goal.objects[0], goal.targets[0], off=0.0099, turn=math.radians(14.9))
        task.advance()
        assert task.score() == pytest.approx((i + 1) / 5)
    assert task.done() and task.instruction == "done assembling kit." and task.expert_action() is None


def test_slightly_outside_the_tolerance_is_worth_nothing(world: SimWorld) -> None:
    task = reset(world, SEQ, "test", 0)
    goal = task.goals[0]
    put(world, goal.objects[0], goal.targets[0], off=0.0101)
    assert task.score() == 0.0
    # every shape's period is 60 degrees or more, or the yaw does not count at all
    put(world, goal.objects[0], goal.targets[0], turn=math.radians(15.1))
    task.advance()
    assert task.score() == (0.2 if goal.symmetries == (0.0,) else 0.0)


def test_a_later_shape_counts_only_with_an_action_of_its_own(world: SimWorld) -> None:
    task = reset(world, SEQ, "test", 1)
    first, second, third = task.goals[:3]
    put(world, second.objects[0], second.targets[0])
    task.advance()
    assert task.score() == 0.0 and task.instruction == first.sentence
    put(world, first.objects[0], first.targets[0])
    task.advance()
    assert task.score() == pytest.approx(0.2) and task.present_goal is second
    task.advance()
    assert task.score() == pytest.approx(0.4) and task.present_goal is third


def test_a_shape_that_was_placed_may_leave_again_without_loss(world: SimWorld) -> None:
    task = reset(world, SEQ, "test", 2)
    goal = task.goals[0]
    put(world, goal.objects[0], goal.targets[0])
    task.advance()
    put(world, goal.objects[0], goal.targets[0], off=0.05)
    assert task.score() == pytest.approx(0.2)


def test_only_its_own_print_counts_for_one_of_two_equal_shapes(world: SimWorld) -> None:
    task, goal, twin = next(found for seed in range(30) if (found := _twins(reset(world, SEQ, "test", seed))))
    put(world, goal.objects[0], twin.targets[0])
    assert task.score() == 0.0
    put(world, twin.objects[0], goal.targets[0])
    assert task.score() == 0.0


def _twins(task: KitTask) -> tuple[KitTask, Goal, Goal] | None:
    goal = task.goals[0]
    same = [other for other in task.goals[1:] if other.objects[0].name == goal.objects[0].name]
    return (task, goal, same[0]) if same else None


def test_the_metric_knows_symmetries_and_the_triangles_too_short_one(world: SimWorld) -> None:
    periods: dict[str, float] = {}
    for seed in range(12):
        for goal in reset(world, SEQ_FULL, "train", seed).goals:
            periods[goal.objects[0].name] = goal.symmetries[0]
    assert len(periods) > 15
    assert periods == {shape.name: shape.period for shape in KIT_SHAPES if shape.name in periods}


@pytest.mark.parametrize("name", [SEQ, SEQ_UNSEEN, SEQ_FULL, ANY])
@pytest.mark.parametrize("split", ["train", "val", "test"])
def test_a_kit_has_five_prints_and_a_loose_shape_for_each_of_the_splits_colours(
    world: SimWorld, name: str, split: str
) -> None:
    names: set[str] = set()
    for seed in range(4):
        task = reset(world, name, split, seed)
        kit, *holes = [thing for thing in task.objects if thing.fixed]
        assert kit.name == "kit" and len(holes) == 5 and len(loose(task)) == 5
        assert Counter(f"{thing.name} hole" for thing in loose(task)) == Counter(hole.name for hole in holes)
        colors = [thing.color for thing in loose(task)]
        assert len(set(colors)) == 5 and set(colors) <= set(_palette(name, split))
        assert name != ANY or colors == ["purple", "blue", "green", "yellow", "red"]
        names |= {thing.name for thing in loose(task)}
        spec = world.config.workspace
        corners = outline(world, kit)
        assert (corners > (spec.x_min, spec.y_min)).all() and (corners < (spec.x_max, spec.y_max)).all()
    wanted = SEEN_NAMES | UNSEEN_NAMES if name == SEQ_FULL else SEEN_NAMES if split == "train" else UNSEEN_NAMES
    assert names <= wanted


def _palette(name: str, split: str) -> tuple[str, ...]:
    if name in (SEQ_FULL, ANY):
        return tuple(COLORS)
    return UNSEEN_PALETTE if name == SEQ_UNSEEN and split != "train" else SEEN_PALETTE


def test_sentences_name_colour_and_shape_and_which_of_equal_prints(world: SimWorld) -> None:
    words = set()
    for seed in range(20):
        task = reset(world, SEQ, "val", seed)
        counts = Counter(thing.name for thing in loose(task))
        for goal in task.goals:
            thing = goal.objects[0]
            before, after = f"put the {thing.color} {thing.name} in the ", f"{thing.name} hole"
            assert goal.sentence.startswith(before) and goal.sentence.endswith(after)
            word = goal.sentence[len(before) : -len(after)]
            assert (word == "") == (counts[thing.name] == 1)
            words.add(word)
    assert words >= {"", "top ", "bottom ", "left ", "right ", "middle "}


def test_which_of_equal_prints_goes_by_where_the_robot_sees_them() -> None:
    here = np.array([0.45, 0.0])
    steep, level, beside = np.array([0.08, 0.04]), np.array([0.04, 0.08]), np.array([0.01, 0.08])
    assert which_of(here, []) == ""
    assert which_of(here, [here + steep]) == "top "
    assert which_of(here, [here - steep]) == "bottom "
    assert which_of(here, [here + level]) == "left "
    assert which_of(here, [here + steep, here + beside]) == "left "
    assert which_of(here, [here - level]) == "right "
    assert which_of(here, [here + level, here - level]) == "middle "


def test_any_print_of_its_shape_counts_in_the_demonstrated_task(world: SimWorld) -> None:
    def twins(task: KitTask) -> list[int]:
        goal = task.goals[0]
        return next(([i, *others] for i in range(5) if len(others := _others(goal.matches[i], i)) == 1), [])

    task = next(task for seed in range(30) if twins(task := reset(world, ANY, "test", seed)))
    i, j = twins(task)
    goal = task.goals[0]
    assert task.max_steps == 10 and task.instruction == "put all the blocks inside the holes they fit in"
    put(world, goal.objects[i], goal.targets[j])
    assert task.score() == pytest.approx(0.2)
    put(world, goal.objects[j], goal.targets[i])
    assert task.score() == pytest.approx(0.4)
    for k in {0, 1, 2, 3, 4} - {i, j}:
        put(world, goal.objects[k], goal.targets[k])
    assert task.score() == pytest.approx(1.0) and task.done()
    assert task.instruction == "done assembling kit."
    wrong = next(k for k in range(5) if not goal.matches[i, k])
    put(world, goal.objects[i], goal.targets[wrong])
    assert task.score() == pytest.approx(0.8)


def _others(row: np.ndarray, i: int) -> list[int]:  # type: ignore[type-arg]
    return [int(k) for k in np.flatnonzero(row) if k != i]


def carry(world: SimWorld, thing: SceneObject, action: PickPlaceAction) -> None:
    here = world.planar_pose(thing)
    put(world, thing, (action.place @ action.pick.inverse() @ here).as_pose())


def test_a_mistake_puts_the_named_shape_wrong_and_the_expert_puts_it_right(world: SimWorld) -> None:
    rng, wrong_prints = np.random.default_rng(0), 0
    for seed in range(8):
        task = reset(world, SEQ, "train", seed)
        shape, own = task.goals[0].objects[0], task.goals[0].targets[0].translation[:2]
        others = [goal.targets[0].translation[:2] for goal in task.goals[1:]]
        mistake = task.mistake(rng)
        assert mistake is not None
        carry(world, shape, mistake)
        at = world.object_xy(shape)
        assert min(np.linalg.norm(at - print_) for print_ in (own, *others)) < 1e-3
        wrong_prints += bool(np.linalg.norm(at - own) > 0.01)
        task.advance()
        assert task.score() == 0.0 and task.goals_reached == 0
        action = task.expert_action()
        assert action is not None and task.judge(action.pick, action.place).pick_right
        carry(world, shape, action)
        task.advance()
        assert task.score() == pytest.approx(0.2) and task.goals_reached == 1
    assert 0 < wrong_prints < 8, "some are turned wrongly in their own print"


def test_a_round_shape_has_no_mistake_when_no_print_waits(world: SimWorld) -> None:
    rounds = {"ring", "circle"}
    tasks = (reset(world, SEQ, "train", seed) for seed in range(60))
    task = next(task for task in tasks if task.goals[-1].objects[0].name in rounds)
    for goal in task.goals:
        mistake = task.mistake(np.random.default_rng(0))
        assert (mistake is None) == (goal is task.goals[-1])
        put(world, goal.objects[0], goal.targets[0])
        task.advance()
    assert task.done() and task.mistake(np.random.default_rng(0)) is None


def test_the_expert_brings_the_named_shape_over_its_print(world: SimWorld) -> None:
    for seed in range(5):
        task = reset(world, SEQ, "val", seed)
        goal = task.goals[0]
        action = task.expert_action()
        assert action is not None and task.instruction == goal.sentence
        choice = task.judge(action.pick, action.place)
        assert choice.pick_right and choice.place_right and choice.picked == goal.objects[0].described
        # moved as the hand moves it, it lies right
        carry(world, goal.objects[0], action)
        assert task.score() == pytest.approx(0.2)
        assert task.expert_action() is None


@pytest.mark.parametrize("name", [SEQ, ANY])
def test_the_same_seed_is_the_same_scene(world: SimWorld, name: str) -> None:
    def scene() -> list[object]:
        task = reset_scene(world, name, "train", 3)
        return [task.instruction, *((o.described, world.object_pose(o).as_matrix().tolist()) for o in task.objects)]

    first = scene()
    reset_scene(world, name, "train", 4)
    assert scene() == first


def test_a_workspace_without_room_for_the_kit_is_refused() -> None:
    world = SimWorld(SimConfig(workspace=WorkspaceSpec(x_min=0.3, x_max=0.5), max_layouts=2))
    with pytest.raises(LayoutError, match=r"no place for a kit of 280 mm x 200 mm on 0.20 m x 0.80 m"):
        reset_scene(world, ANY, "test", 0)
    world.close()
