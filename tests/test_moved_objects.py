"""Objects that are moved in physics while the arm is on its way to them: what comes of it, and no crash into one.

`make soak PYTEST_ARGS="tests/test_moved_objects.py -s"` runs this; out/moved_objects.json has the table.
"""

from __future__ import annotations

import json
import math
from collections import Counter
from dataclasses import dataclass

import numpy as np
import pybullet
import pytest
from hardware_times import ROOT

from cliport_benchmark.observer import Observer
from cliport_benchmark.sim_arm import SimArmPort, SimGripperPort, SimMotion
from cliport_core import ActionGoal, Outcome, PickPlaceAction, PlanarPose
from panda_executor.model import PandaModel
from panda_executor.phase import Phase
from panda_executor.runner import PickPlaceRunner
from panda_executor.transfer import TransferPlanner
from sim_bridge.objects import SceneObject, block_shape
from sim_bridge.objects.block import BLOCK_SIZE
from sim_bridge.robot import ROBOT
from sim_bridge.world import SimWorld

SHIFTS = (0.0, 0.01, 0.03, 0.1)  # [m]
SEEDS = range(5)
AFTER = 0.3  # from the beginning of the way to the object until it is moved [s]
CRASH = 10.0  # of the arm on an object that it has not begun to grasp [N]; a block weighs less than 1 N
OUT = ROOT / "out" / "moved_objects.json"

pytestmark = [pytest.mark.soak, pytest.mark.timeout(3600)]


@dataclass
class Approach:
    """The way to one block, which is moved by `shift` (2,) [m] once, and how hard the arm touched it before closing."""

    world: SimWorld
    block: SceneObject
    shift: np.ndarray
    force: float = 0.0  # [N]
    phase: Phase = Phase.VALIDATING
    left: float = AFTER  # [s]

    def on_phase(self, phase: Phase, progress: float) -> None:
        """Take note of the phase."""
        self.phase = phase

    def on_tick(self) -> None:
        """Move the block when it is time; measure how hard the arm touches it."""
        if self.phase is Phase.GO_ABOVE_PICK and self.left > 0.0:
            self.left -= self.world.dt
            if self.left <= 0.0:
                at = self.world.planar_pose(self.block)
                moved = PlanarPose(at.x + self.shift[0], at.y + self.shift[1], at.yaw)
                self.world.move_object(self.block, moved.as_pose(BLOCK_SIZE / 2))
        if self.phase in (Phase.GO_ABOVE_PICK, Phase.DESCEND):
            arm, block = self.world.panda.body, self.block.body
            touches = pybullet.getContactPoints(arm, block, physicsClientId=self.world.client)
            self.force = max([self.force, *(float(touch[9]) for touch in touches)])


def approach(shift: float, seed: int) -> tuple[str, float]:
    """Return how a pick of a block that is moved by `shift` [m] ended, and the greatest force before it closed [N]."""
    random = np.random.default_rng([9, seed])
    world = SimWorld()
    try:
        bearing, yaw = random.uniform(-math.pi, math.pi, 2)
        pick = PlanarPose(*random.uniform([0.4, 0.0], [0.5, 0.2]), float(yaw) / 2.0)
        block = world.add(block_shape(), pick.as_pose(BLOCK_SIZE / 2), "red")
        watched = Approach(world, block, shift * np.array([math.cos(bearing), math.sin(bearing)]))
        motion = SimMotion(world, watched.on_tick)
        observer = Observer(world.config, n_threads=1)
        model = PandaModel(ROBOT)
        planner = TransferPlanner(model)
        planner.place_cameras(observer.camera.camera_in_base.translation)
        runner = PickPlaceRunner(model, planner, SimArmPort(motion), SimGripperPort(motion))

        def seen() -> np.ndarray:
            return observer.cloud(observer.frame(world))

        action = PickPlaceAction(pick, PlanarPose(0.5, -0.2, 0.3))
        result = runner.run(ActionGoal(action), seen(), observer.workspace, watched.on_phase, look=seen)
        assert watched.left <= 0.0, "it was never moved"
        return result.outcome.name, watched.force
    finally:
        world.close()


def test_no_object_that_was_moved_is_crashed_into() -> None:
    table = {}
    for shift in SHIFTS:
        ends = [approach(shift, seed) for seed in SEEDS]
        outcomes = Counter(outcome for outcome, _ in ends)
        table[f"{100 * shift:g} cm"] = {"outcomes": dict(outcomes), "force_n": max(force for _, force in ends)}
        print(f"{100 * shift:g} cm:", table[f"{100 * shift:g} cm"], flush=True)
    OUT.parent.mkdir(exist_ok=True)
    OUT.write_text(json.dumps(table, indent=1) + "\n")
    assert all(row["force_n"] < CRASH for row in table.values()), table
    assert table["0 cm"]["outcomes"] == {Outcome.SUCCEEDED.name: len(SEEDS)}
    assert Outcome.SUCCEEDED.name not in table["10 cm"]["outcomes"]
