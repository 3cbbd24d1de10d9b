"""The arm of the benchmark begins each action with an empty hand."""

from types import SimpleNamespace
from typing import Any

import pytest

from cliport_benchmark import arm_hand
from cliport_benchmark.arm_hand import ArmHand
from cliport_benchmark.observer import Observer
from cliport_core import PickPlaceAction, PlanarPose, Primitive
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
