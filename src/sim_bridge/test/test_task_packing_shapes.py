"""packing-unseen-shapes: scene, sentence, metric and expert."""

import math
from collections.abc import Iterator

import numpy as np
import pytest

from cliport_core import PlanarPose, Pose
from sim_bridge.colors import SEEN_PALETTE, UNSEEN_PALETTE
from sim_bridge.objects import SceneObject
from sim_bridge.objects.container import CONTAINER_HEIGHT
from sim_bridge.objects.kit_shapes import KIT_SHAPES, SEEN_SHAPES, UNSEEN_SHAPES
from sim_bridge.scene import reset_scene
from sim_bridge.tasks import Task
from sim_bridge.world import SimWorld

NAME = "packing-unseen-shapes"


@pytest.fixture(scope="module")
def world() -> Iterator[SimWorld]:
    world = SimWorld()
    yield world
    world.close()


def parts(task: Task) -> tuple[SceneObject, SceneObject, list[SceneObject]]:
    """The container, the shape that is asked for, and the others."""
    box, target, *others = task.objects
    return box, target, others


def put(world: SimWorld, thing: SceneObject, box: SceneObject, off: tuple[float, float]) -> None:
    """Put a thing's middle at `off` [m] in the container's frame."""
    at = world.object_pose(box) @ Pose.from_xyz_rpy((*off, -0.01), (0.0, 0.0, 0.4))
    world.move_object(thing, at)


@pytest.mark.parametrize("seed", range(4))
def test_the_named_shape_counts_while_its_middle_is_inside(world: SimWorld, seed: int) -> None:
    task = reset_scene(world, NAME, "test", seed)
    box, target, others = parts(task)
    assert task.score() == 0.0 and task.max_steps == 1
    assert task.instruction == f"pack the {target.name} in the brown box"
    half = np.ptp(box.mesh.vertices[:, 0]) / 2
    put(world, target, box, (half + 0.005, 0.0))
    assert task.score() == 0.0
    put(world, others[0], box, (0.0, 0.0))
    assert task.score() == 0.0
    put(world, target, box, (half - 0.005, 0.0))
    assert task.score() == 1.0 and task.done()
    assert task.instruction == "done packing shapes." and task.expert_action() is None


def test_above_the_box_is_not_inside(world: SimWorld) -> None:
    task = reset_scene(world, NAME, "test", 0)
    box, target, _ = parts(task)
    at = world.object_pose(box).translation
    world.move_object(target, Pose.from_xyz_rpy((at[0], at[1], CONTAINER_HEIGHT / 2 + 0.32), (0.0, 0.0, 0.0)))
    assert task.score() == 0.0


@pytest.mark.parametrize(("split", "palette"), [("train", SEEN_PALETTE), ("val", UNSEEN_PALETTE)])
def test_five_different_shapes_of_five_colours_and_a_fixed_box(
    world: SimWorld, split: str, palette: tuple[str, ...]
) -> None:
    allowed = {KIT_SHAPES[i].name for i in (SEEN_SHAPES if split == "train" else UNSEEN_SHAPES)}
    for seed in range(8):
        box, target, others = parts(reset_scene(world, NAME, split, seed))
        assert box.fixed and box.name == "brown box"
        width, depth = np.ptp(box.mesh.vertices[:, 0]), np.ptp(box.mesh.vertices[:, 1])
        assert min(width, depth) > 0.099 and max(width, depth) < 0.153
        things = [target, *others]
        assert len({thing.name for thing in things}) == len({thing.color for thing in things}) == len(things) == 5
        assert {thing.name for thing in things} <= allowed and {thing.color for thing in things} <= set(palette)
        assert not any(thing.fixed for thing in things)


def test_the_expert_puts_the_shape_into_the_middle(world: SimWorld) -> None:
    for seed in range(8):
        task = reset_scene(world, NAME, "val", seed)
        box, target, _ = parts(task)
        action = task.expert_action()
        assert action is not None
        choice = task.judge(action.pick, action.place)
        assert choice.pick_right and choice.place_right and choice.picked == target.described
        here, turn = world.planar_pose(target), action.place.yaw - action.pick.yaw
        c, s = math.cos(turn), math.sin(turn)
        dx, dy = here.x - action.pick.x, here.y - action.pick.y
        there = PlanarPose(action.place.x + c * dx - s * dy, action.place.y + s * dx + c * dy, 0.0)
        assert (there.x, there.y) == pytest.approx(tuple(world.object_xy(box)), abs=1e-6)


def test_the_same_seed_is_the_same_scene_under_either_name(world: SimWorld) -> None:
    def scene(name: str) -> list[object]:
        task = reset_scene(world, name, "train", 3)
        return [task.instruction, *((o.described, world.object_pose(o).as_matrix().tolist()) for o in task.objects)]

    assert scene(NAME) == scene("packing-shapes")
