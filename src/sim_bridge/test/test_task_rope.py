"""align-rope and manipulating-rope: sides, slots, metric, and an expert that brings beads nearer.

As a command it counts the scenes in which the rope lies across itself:

    python src/sim_bridge/test/test_task_rope.py
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import pytest

from cliport_core import PlanarPose, Pose, Primitive
from sim_bridge.objects.rope import BEAD_SIZE, BEAD_SPACING, ROPE_BEADS, SQUARE_SIDE
from sim_bridge.scene import reset_scene
from sim_bridge.task_mechanics.folding import next_fold
from sim_bridge.tasks.align_rope import SIDES, AlignRope
from sim_bridge.world import SimWorld


@pytest.fixture(scope="module")
def world() -> Iterator[SimWorld]:
    world = SimWorld()
    yield world
    world.close()


def scene(world: SimWorld, seed: int, name: str = "align-rope") -> AlignRope:
    task = reset_scene(world, name, "val", seed)
    assert isinstance(task, AlignRope)
    return task


@dataclass(frozen=True)
class Fallen:
    """What a scene of align-rope begins with: its sentence, and the beads' colours and places (20, 3) [m]."""

    instruction: str
    colors: list[str]
    at: np.ndarray


def fallen(world: SimWorld, seed: int) -> Fallen:
    task = scene(world, seed)
    places = np.array([world.object_pose(bead).translation for bead in task.beads])
    return Fallen(task.instruction, [bead.color for bead in task.beads], places)


@pytest.fixture(scope="module")
def scenes(world: SimWorld) -> list[Fallen]:
    """Of the first six seeds."""
    return [fallen(world, seed) for seed in range(6)]


def lay(world: SimWorld, task: AlignRope, order: list[int], off: float = 0.0) -> None:
    """Bead i into slot order[i], `off` metres beside the side."""
    slots = np.array([target.translation for target in task.goals[0].targets])
    along = (slots[-1] - slots[0]) / np.linalg.norm(slots[-1] - slots[0])
    beside = np.array([-along[1], along[0], 0.0]) * off + (0.0, 0.0, 0.005)
    for bead, slot in zip(task.beads, order, strict=True):
        world.move_object(bead, Pose(np.eye(3), slots[slot] + beside))


def test_the_rope_counts_from_either_end_bead_by_bead(world: SimWorld) -> None:
    task = scene(world, 0)
    straight = list(range(ROPE_BEADS))
    for order in (straight, straight[::-1]):
        lay(world, task, order)
        assert task.score() == 1.0 and task.done() and task.expert_action() is None
    lay(world, task, straight, off=0.0199)
    assert task.score() == 1.0
    lay(world, task, straight, off=0.0201)
    assert task.score() == 0.0
    lay(world, task, straight)
    for bead in task.beads[:10]:
        world.move_object(bead, Pose.from_xyz_rpy((0.3, 0.39, 0.005), (0, 0, 0)))
    assert task.score() == 0.5 and not task.done()
    lay(world, task, straight[5:] + straight[:5])  # the wrong order
    assert task.score() < 0.5


def test_neighbours_hang_together_and_the_ends_are_white(scenes: list[Fallen]) -> None:
    for each in scenes:
        np.testing.assert_allclose(np.linalg.norm(np.diff(each.at, axis=0), axis=1), BEAD_SPACING, atol=2e-3)
        assert each.colors == ["white", *["red"] * 18, "white"]
        assert (each.at[:, 2] < 0.05).all()


def lies_across_itself(beads: np.ndarray) -> bool:
    """Two beads (20, 2) [m] that are no neighbours are nearer to each other than a bead is wide."""
    apart = np.linalg.norm(beads[:, None] - beads[None], axis=-1)
    return bool((apart[np.triu_indices(ROPE_BEADS, 3)] < BEAD_SIZE).any())


def test_the_rope_falls_into_a_heap_another_one_in_each_scene(scenes: list[Fallen]) -> None:
    lying = [each.at[:, :2] for each in scenes]
    assert all(np.ptp(beads, axis=0).max() < 0.2 for beads in lying)
    apart = [np.linalg.norm(beads[:, None] - beads[None], axis=-1) for beads in lying]
    assert sum(map(lies_across_itself, lying)) >= 3
    for i in range(1, len(lying)):
        assert np.abs(apart[i] - apart[0]).max() > 0.01


def test_the_rope_may_start_inside_the_square(world: SimWorld) -> None:
    for seed in range(40):
        task = scene(world, seed)
        middle = np.array([world.object_xy(bead) for bead in task.beads]).mean(axis=0)
        square = world.object_pose(task.objects[0])
        if (np.abs(square.inverse().apply(np.array([*middle, 0.0]))[:2]) < SQUARE_SIDE / 2).all():
            return
    pytest.fail("the rope lies beside the square in every scene")


def test_every_side_is_asked_for_and_the_demo_task_asks_for_the_missing_one(
    world: SimWorld, scenes: list[Fallen]
) -> None:
    wanted = {f"align the rope from {words}" for _, _, words in SIDES}
    asked = {each.instruction for each in scenes}
    for seed in range(len(scenes), 16):
        if asked == wanted:
            break
        asked.add(scene(world, seed).instruction)
    task, rng = scene(world, 0), np.random.default_rng(0)
    assert asked == {task.sentence(task.side(rng)) for _ in range(100)} == wanted
    task = scene(world, 0, "manipulating-rope")
    assert task.instruction == "manipulate the rope to complete the square" and task.max_steps == 20


def test_the_same_seed_is_the_same_rope(world: SimWorld, scenes: list[Fallen]) -> None:
    scene(world, 6)
    np.testing.assert_array_equal(fallen(world, 5).at, scenes[5].at)


def test_the_expert_folds_a_bead_to_a_slot(world: SimWorld) -> None:
    task = scene(world, 1)
    action = task.expert_action()
    assert action is not None and action.primitive is Primitive.FOLD
    choice = task.judge(action.pick, action.place)
    assert choice.picked.endswith("bead") and choice.place_right


def test_a_mistake_drags_a_bead_to_an_end_of_the_side(world: SimWorld) -> None:
    task, taken, put = scene(world, 3), set[int](), set[int]()
    beads = np.array([world.object_xy(bead) for bead in task.beads])
    slots = np.array([target.translation[:2] for target in task.goals[0].targets])
    for seed in range(40):
        action = task.mistake(np.random.default_rng(seed))
        assert action is not None and action.primitive is Primitive.FOLD
        for at, points, found in ((action.pick, beads, taken), (action.place, slots, put)):
            distance = np.linalg.norm(points - (at.x, at.y), axis=1)
            assert distance.min() < 1e-6
            found.add(int(distance.argmin()))
    assert len(taken) > 10 and put == {0, ROPE_BEADS - 1}
    lay(world, task, list(range(ROPE_BEADS)))
    assert task.mistake(np.random.default_rng(0)) is None


def test_a_bead_that_is_pinched_beside_its_middle_is_judged_where_the_fold_takes_it(world: SimWorld) -> None:
    """A fold acts where it is told, so a pick 8 mm beside the bead leaves the bead 8 mm behind the place."""
    task = scene(world, 1)
    beads = np.array([world.object_xy(bead) for bead in task.beads])
    end = next(i for i in (0, ROPE_BEADS - 1) if np.sort(np.linalg.norm(beads - beads[i], axis=1))[1] > 0.012)
    slot = task.goals[0].targets[end].translation[:2]
    away = beads[end] - beads[np.argsort(np.linalg.norm(beads - beads[end], axis=1))[1]]
    shift = 0.008 * away / np.linalg.norm(away)
    pick = PlanarPose(*(beads[end] + shift).tolist(), 0.3)
    for far, right in ((2.0, True), (3.0, True), (4.0, False)):  # the bead comes 8, 16 and 24 mm from its slot
        judged = task.judge(pick, PlanarPose(*(slot + far * shift).tolist(), 0.3))
        assert judged == task.judge(pick, PlanarPose(*(slot + far * shift).tolist(), 0.3), exact_offset=True)
        assert (judged.picked, judged.place_right) == ("white bead", right)


def test_an_end_beside_the_rope_is_worth_more_than_a_bead_almost_right() -> None:
    slots = np.column_stack([np.full(ROPE_BEADS, 0.5), np.arange(ROPE_BEADS) * BEAD_SPACING])
    beads = slots + np.array([0.012, 0.0])
    beads[:5] = beads[10:5:-1] + np.array([0.016, 0.0])  # folded back at bead 5; the fingers would meet the rest there
    chosen, action = next_fold(beads, slots)
    assert action is not None and chosen == 0
    np.testing.assert_allclose((action.pick.x, action.pick.y), beads[0])
    np.testing.assert_allclose((action.place.x, action.place.y), slots[0])


def test_ends_go_first_and_then_what_is_far() -> None:
    slots = np.column_stack([np.full(ROPE_BEADS, 0.5), np.arange(ROPE_BEADS) * BEAD_SPACING])
    beads = slots + np.array([0.012, 0.0])
    beads[7, 0] += 0.1
    for _ in range(2):
        chosen, action = next_fold(beads, slots)
        assert chosen in (0, ROPE_BEADS - 1) and action is not None
        beads[chosen] = slots[chosen]
    assert next_fold(beads, slots)[0] == 7
    beads[0] += 0.012
    in_vain = np.zeros(ROPE_BEADS, int)
    in_vain[0] = 1
    assert next_fold(beads, slots)[0] == 0 and next_fold(beads, slots, in_vain)[0] == 7


def test_a_bead_that_was_tried_in_vain_waits_for_another(world: SimWorld) -> None:
    task = scene(world, 1)
    picked = []
    for _ in range(3):  # nothing is done about them
        action = task.expert_action()
        assert action is not None
        picked.append((action.pick.x, action.pick.y))
        task.advance()
    assert len(set(picked)) == 3


if __name__ == "__main__":
    world = SimWorld()
    print(f"{sum(lies_across_itself(fallen(world, seed).at[:, :2]) for seed in range(30))} of 30 validation scenes")
