"""Carries out a pick and place with the simulated arm, through the executor's library."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from cliport_benchmark.observer import Observer
from cliport_benchmark.sim_arm import SimArmPort, SimGripperPort, SimMotion
from cliport_core import ActionGoal, ActionResult, PickPlaceAction, Primitive
from panda_executor.config import AfterFailure, ExecutorConfig
from panda_executor.model import PandaModel
from panda_executor.phase import Phase
from panda_executor.runner import PickPlaceRunner
from panda_executor.transfer import TransferPlanner
from panda_model.limits import FloatArray
from sim_bridge.rendering.camera import RgbdFrame
from sim_bridge.robot import HOME_TOLERANCE, ROBOT
from sim_bridge.sleeping import come_to_rest, sleep_where_still
from sim_bridge.world import SimWorld

_NO_TIME_LIMIT = 600.0  # [s]
_PLANNING_TIME = 15.0  # of a request, by the clock of poses [s]; plans found for box pairs took 0.1 to 0.3
_POSE_S = 1e-4  # what a look at a pose of the arm counts [s], about what it takes
_ANY_HEIGHT = 600.0  # of the table [m]
_REST = 0.1  # after an action, before the world is judged to be still [s]


class _CountingModel(PandaModel):
    """A model that counts the poses it is asked for: a clock for planning that is as fast on every machine."""

    poses = 0

    def tcp_arrays_now(self) -> tuple[FloatArray, FloatArray]:
        self.poses += 1
        return super().tcp_arrays_now()


class ArmHand:
    """The arm of one world. Deterministic: the same world and requests give the same motions.

    on_tick: called after every step of the world that the arm makes. exact_offset: a thing that is picked off its
    middle is placed as far off, instead of centred.
    """

    def __init__(
        self,
        world: SimWorld,
        observer: Observer,
        on_tick: Callable[[], None] | None = None,
        exact_offset: bool = False,
    ) -> None:
        self._world = world
        self._observer = observer
        self._motion = SimMotion(world, on_tick)
        config, model = replace(_executor_config(), centre_grasp=not exact_offset), _CountingModel(ROBOT)
        planner = TransferPlanner(model, config, clock=lambda: model.poses * _POSE_S)
        planner.place_cameras(observer.camera.camera_in_base.translation)
        self._runner = PickPlaceRunner(
            model,
            planner,
            SimArmPort(self._motion),
            SimGripperPort(self._motion),
            config,
        )

    def new_scene(self, primitive: Primitive) -> None:
        """Take note that the world was reset, with the arm at home, to a scene in which the hand does that."""
        self._motion.reset()
        if primitive is not Primitive.PICK_PLACE:
            come_to_rest(self._world)

    def execute(self, action: PickPlaceAction, frame: RgbdFrame) -> ActionResult:
        """Execute an action, with the frame's cloud for grasp height and obstacles, and let the world settle."""
        drags = action.primitive is not Primitive.PICK_PLACE
        result = self._runner.run(
            ActionGoal(action),
            self._observer.cloud(frame),
            self._observer.workspace,
            self._let_released_sleep if drags else _ignore,
            _never,
        )
        away = np.abs(self._world.panda.state().positions - ROBOT.ready).max()
        if away > HOME_TOLERANCE:  # the request ended early: let go and clear the camera's view
            self._runner.open()
            self._runner.go_ready()
        self._motion.rest(_REST)
        if drags:
            come_to_rest(self._world)
        else:
            self._world.settle()
        return result

    def _let_released_sleep(self, phase: Phase, progress: float) -> None:
        """Let things that were swept or laid down sleep, so that they cost nothing while the arm goes away."""
        if phase is Phase.RETREAT:
            sleep_where_still(self._world)


def _executor_config() -> ExecutorConfig:
    """Return the executor's settings, bounded by checks alone: how fast the machine is must not change a score.

    A camera that stands a little elsewhere than calibrated is part of some scenes: the table's height is not judged.
    """
    config = ExecutorConfig.for_arm(ROBOT)
    search = replace(config.search, time_limit=_NO_TIME_LIMIT)
    table = replace(config.table, tolerance=_ANY_HEIGHT)
    return replace(config, search=search, planning_time=_PLANNING_TIME, table=table, after_failure=AfterFailure.STAY)


def _ignore(phase: Phase, progress: float) -> None:
    """Take feedback that nobody asked for."""


def _never() -> bool:
    return False
