"""The arm of the benchmark begins each action with an empty hand, and carries an error of the pick or does not."""

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from cliport_benchmark import arm_hand
from cliport_benchmark.arm_hand import ArmHand
from cliport_benchmark.observer import Observer
from cliport_core import PickPlaceAction, PlanarPose, Primitive
from cliport_core.outcome import Outcome
from sim_bridge.robot import HAND
from sim_bridge.scene import reset_scene
from sim_bridge.world import SimWorld


def test_after_a_failure_the_executor_knows_that_the_hand_let_go(monkeypatch: pytest.MonkeyPatch) -> None:
    """It had held a box as wide as the open hand: the next scene's actions were all refused."""
    world = SimWorld()
    try:
        reset_scene(world, "put-blocks-in-bowls-seen-colors", "val", 0)
        observer = Observer(world.config)
        arm = ArmHand(world, observer)
        arm.new_scene(Primitive.PICK_PLACE)
        hand = arm._runner._hand

        def fail(*_: Any) -> Any:
            hand.note(0.0, HAND.opening)
            assert hand.holds(HAND.opening)
            return SimpleNamespace()

        monkeypatch.setattr(arm._runner, "run", fail)
        monkeypatch.setattr(arm_hand, "HOME_TOLERANCE", -1.0)
        somewhere = PlanarPose.identity()
        arm.execute(PickPlaceAction(somewhere, somewhere), observer.frame(world))
        assert not hand.holds(HAND.opening)
    finally:
        world.close()


def test_planning_ends_by_the_poses_it_looked_at_however_fast_the_machine_is(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where nothing passes, ten minutes went by for each action."""
    world = SimWorld()
    try:
        task = reset_scene(world, "stack-block-pyramid-seq-seen-colors", "val", 0)
        action = task.expert_action()
        assert action is not None
        monkeypatch.setattr(arm_hand, "_PLANNING_TIME", 0.05)
        observer = Observer(world.config)
        arm = ArmHand(world, observer)
        arm.new_scene(task.primitive)
        model = cast(Any, arm._runner.planner.model)
        before = model.poses
        result = arm.execute(action, observer.frame(world))
        assert result.outcome is Outcome.PLANNING_FAILED and "took too long (at most 0.05 s)" in result.message
        assert 500 <= model.poses - before < 1000
    finally:
        world.close()


@pytest.mark.parametrize("direction", [(0.0, 1.0), (1.0, 0.0)], ids=["across the jaws", "along the jaws' way"])
@pytest.mark.parametrize(("exact_offset", "expected"), [(False, 0.0), (True, 0.014)])
def test_a_block_that_is_picked_14_mm_off_is_centred_or_as_far_off_at_the_place(
    exact_offset: bool, expected: float, direction: tuple[float, float]
) -> None:
    """Also where the closing jaws centre the block themselves: the place is moved then."""
    world = SimWorld()
    try:
        task = reset_scene(world, "stack-block-pyramid-seq-seen-colors", "val", 0)
        observer = Observer(world.config)
        arm = ArmHand(world, observer, exact_offset=exact_offset)
        arm.new_scene(task.primitive)
        action = task.expert_action()
        assert action is not None
        x, y, yaw = action.pick.x, action.pick.y, action.pick.yaw
        along, across = 0.014 * np.array(direction)
        cos, sin = math.cos(yaw), math.sin(yaw)
        off = PlanarPose(x + along * cos - across * sin, y + along * sin + across * cos, yaw)
        named = next(thing for thing in task.objects if math.dist(world.object_xy(thing), (x, y)) < 0.005)
        result = arm.execute(replace(action, pick=off), observer.frame(world))
        assert result.outcome is Outcome.SUCCEEDED
        moved = math.dist(world.object_xy(named), (action.place.x, action.place.y))
        assert moved == pytest.approx(expected, abs=0.003)
    finally:
        world.close()
