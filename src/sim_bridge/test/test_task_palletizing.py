"""palletizing-boxes: boxes that come one by one, their stack, metric and expert."""

from collections.abc import Iterator

import numpy as np
import pytest

from cliport_core import Pose
from sim_bridge.scene import reset_scene
from sim_bridge.tasks.palletizing_boxes import PalletizingBoxes
from sim_bridge.world import SimWorld


@pytest.fixture(scope="module")
def world() -> Iterator[SimWorld]:
    world = SimWorld()
    yield world
    world.close()


def set_up(world: SimWorld, seed: int = 5000) -> PalletizingBoxes:
    task = reset_scene(world, "palletizing-boxes", "val", seed)
    assert isinstance(task, PalletizingBoxes)
    return task


def stack_next(world: SimWorld, task: PalletizingBoxes) -> Pose:
    """Put the box that came last where the expert would; its pose there."""
    box, goal = task.objects[-1], task.present_goal
    assert goal is not None
    [target] = [target for thing, target in task.moves_to_make(goal) if thing is box]
    pose = target.as_pose(task.place_level(goal, box) - box.shape.bottom)
    world.move_object(box, pose)
    task.advance()
    return pose


def test_boxes_come_one_by_one_when_their_place_is_free(world: SimWorld) -> None:
    task = set_up(world)
    assert task.instruction == "stack all the boxes on the pallet" and task.max_steps == 30
    pallet, first = task.objects
    assert pallet.fixed and world.object_xy(first)[1] < 0.0
    task.advance()
    assert len(task.objects) == 2
    stack_next(world, task)
    assert len(task.objects) == 3 and task.score() == pytest.approx(1 / 18)
    assert not task.done()


def test_eighteen_boxes_stand_in_three_layers(world: SimWorld) -> None:
    task = set_up(world, 5001)
    poses = []
    for i in range(18):
        assert task.score() == pytest.approx(i / 18)
        poses.append(stack_next(world, task))
    assert task.score() == pytest.approx(1.0) and task.done() and task.expert_action() is None
    assert task.instruction == "done stacking the boxes."
    assert world.settle() and task.score() == pytest.approx(1.0)
    for box, pose in zip(task.objects[1:], poses, strict=True):
        assert np.allclose(world.object_pose(box).translation, pose.translation, atol=2e-3)
    heights = [pose.translation[2] for pose in poses]
    assert heights == sorted(heights) and len({round(z, 4) for z in heights}) == 3
    assert max(heights) + 0.03 < world.config.workspace.z_max


def test_a_box_half_over_the_edge_counts_half(world: SimWorld) -> None:
    task = set_up(world, 5002)
    box = task.objects[1]
    edge = Pose.from_xyz_rpy((0.45 + 0.15, 0.25, 0.07), (0.0, 0.0, 0.0))
    world.move_object(box, edge)
    # the lattice is five points long: three of them are inside
    assert task.score() == pytest.approx(3 / 5 / 18)
    world.move_object(box, edge @ Pose.from_xyz_rpy((0.1, 0.0, 0.0), (0.0, 0.0, 0.0)))
    assert task.score() == 0.0


def test_a_box_that_lies_beside_the_pallet_is_still_to_be_moved(world: SimWorld) -> None:
    task = set_up(world, 5003)
    world.move_object(task.objects[1], Pose.from_xyz_rpy((0.45, 0.05, 0.029), (0.0, 0.0, 0.3)))
    task.advance()
    assert len(task.objects) == 3 and task.score() == 0.0
    goal = task.present_goal
    assert goal is not None and {thing for thing, _ in task.moves_to_make(goal)} == set(task.objects[1:])


def test_a_box_that_was_tried_in_vain_waits_while_others_come(world: SimWorld) -> None:
    task = set_up(world, 5003)
    world.move_object(task.objects[1], Pose.from_xyz_rpy((0.45, 0.05, 0.029), (0.0, 0.0, 0.3)))
    task.advance()
    picks = []
    for _ in range(2):  # nothing is carried out
        action = task.expert_action()
        assert action is not None
        picks.append((action.pick.x, action.pick.y))
        task.advance()
    assert len(task.objects) == 3 and np.linalg.norm(np.subtract(*picks)) > 0.1


def test_the_order_within_a_layer_and_the_yaws_are_drawn(world: SimWorld) -> None:
    def scene(seed: int) -> list[float]:
        task = set_up(world, seed)
        yaw = world.object_yaw(task.objects[1])
        return [yaw, *(float(v) for _ in range(6) for v in stack_next(world, task).translation)]

    assert scene(1) == scene(1)
    assert scene(1) != scene(2)
