"""Sweeps and folds in physics: with the arm, and without it as fast data generation does them."""

from collections.abc import Callable, Iterator

import numpy as np
import pytest

from cliport_benchmark.arm_hand import ArmHand
from cliport_benchmark.kinematic_hand import KinematicHand
from cliport_benchmark.observer import Observer
from cliport_core import PickPlaceAction, PlanarPose, Primitive
from cliport_core.outcome import Outcome
from cliport_core.pose import FloatArray
from sim_bridge.objects import SceneObject
from sim_bridge.objects.pile import PILE_BLOCK_SIZE, pile_block_shape
from sim_bridge.objects.rope import BEAD_SPACING
from sim_bridge.scene import reset_scene
from sim_bridge.tasks.align_rope import AlignRope
from sim_bridge.world import SimWorld

ROW = [(0.45 + dx, dy) for dx in (-0.012, 0.0, 0.012) for dy in (-0.06, -0.02)]


@pytest.fixture(scope="module")
def shared_world() -> Iterator[SimWorld]:
    world = SimWorld()
    yield world
    world.close()


@pytest.fixture(scope="module")
def observer(shared_world: SimWorld) -> Observer:
    return Observer(shared_world.config)


@pytest.fixture
def act(shared_world: SimWorld, observer: Observer, with_arm: bool) -> Callable[..., object]:
    """Carries an action out, with the arm or without."""
    hand: ArmHand | KinematicHand = KinematicHand(shared_world, np.random.default_rng(0))
    if with_arm:
        hand = ArmHand(shared_world, observer)
        hand.new_scene(Primitive.PICK_PLACE)

    def act(pick: PlanarPose, place: PlanarPose, primitive: Primitive) -> object:
        return hand.execute(PickPlaceAction(pick, place, primitive), observer.frame(shared_world))

    return act


def places(world: SimWorld, things: list[SceneObject]) -> FloatArray:
    return np.array([world.object_pose(thing).translation for thing in things])


@pytest.mark.parametrize("with_arm", [True, False])
def test_a_sweep_pushes_what_is_before_the_hand_and_nothing_else(
    shared_world: SimWorld, act: Callable[..., object], with_arm: bool
) -> None:
    world = shared_world
    reset_scene(world, "put-blocks-in-bowls-seen-colors", "val", 0)
    for thing in world.objects:
        world.remove(thing)
    height = PILE_BLOCK_SIZE / 2
    blocks = [world.add(pile_block_shape(), PlanarPose(x, y, 0.3).as_pose(height), "red") for x, y in ROW]
    beside = world.add(pile_block_shape(), PlanarPose(0.49, 0.0, 0.0).as_pose(height), "blue")
    result = act(PlanarPose(0.45, -0.1, 0.0), PlanarPose(0.45, 0.08, 0.0), Primitive.SWEEP)
    assert not with_arm or result.outcome is Outcome.SUCCEEDED  # type: ignore[attr-defined]
    after = places(world, blocks)
    assert (after[:, 1] > 0.08).all() and (after[:, 1] < 0.125).all()
    assert np.abs(after[:, 0] - 0.45).max() < 0.04 and np.abs(after[:, 2] - height).max() < 1e-3
    np.testing.assert_allclose(places(world, [beside])[0], [0.49, 0.0, height], atol=1e-3)


@pytest.mark.parametrize("with_arm", [True, False])
def test_a_fold_takes_a_bead_to_its_place_and_the_rope_follows(
    shared_world: SimWorld, act: Callable[..., object], with_arm: bool
) -> None:
    world = shared_world
    task = reset_scene(world, "align-rope", "val", 5003)
    assert isinstance(task, AlignRope)
    action = task.expert_action()
    assert action is not None
    beads = list(task.beads)
    before = places(world, beads)
    moved = int(np.argmin(np.linalg.norm(before[:, :2] - (action.pick.x, action.pick.y), axis=1)))
    result = act(action.pick, action.place, action.primitive)
    assert not with_arm or result.outcome is Outcome.SUCCEEDED  # type: ignore[attr-defined]
    after = places(world, beads)
    assert np.linalg.norm(after[moved, :2] - (action.place.x, action.place.y)) < 0.012
    np.testing.assert_allclose(np.linalg.norm(np.diff(after, axis=0), axis=1), BEAD_SPACING, atol=1e-3)
    assert (after[:, 2] < 0.02).all() and task.score() > 0.0
    if with_arm:
        for _ in range(60):
            world.step()
        np.testing.assert_array_equal(places(world, beads), after)  # asleep: it costs nothing until it is touched
