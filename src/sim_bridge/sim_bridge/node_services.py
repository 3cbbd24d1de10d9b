"""Services of the simulator: make a scene, read its score."""

from __future__ import annotations

from typing import cast

import numpy as np
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.node import Node

from cliport_core import topics
from cliport_interfaces.srv import GetScore, ResetTask
from sim_bridge.errors import LayoutError, PhysicsError, SimBridgeError, SimulationError
from sim_bridge.panda import ArmState
from sim_bridge.robot import ROBOT
from sim_bridge.scene import reset_scene
from sim_bridge.sim_loop import SimLoop
from sim_bridge.task_mechanics.task import Task
from sim_bridge.world import SimWorld

_JUDGED_EVERY = 0.1  # that the arm may have come home [s]
_HOME_TOLERANCE = 0.02  # [rad]


class SceneServices:
    """Serves the simulator's reset and score. An empty task or split in a request keeps the present one.

    task, seed: the scene that the loop's world shows now.
    """

    def __init__(self, node: Node, loop: SimLoop, task: Task, seed: int) -> None:
        self._loop = loop
        self._task: Task | None = task
        self._seed = seed
        self._logger = node.get_logger()
        self._was_away = False  # the arm, since the scene was judged
        loop.every(_JUDGED_EVERY, self._watch)
        group = MutuallyExclusiveCallbackGroup()
        node.create_service(ResetTask, topics.SIM_RESET, self._reset, callback_group=group)
        node.create_service(GetScore, topics.SIM_SCORE, self._score, callback_group=group)

    @property
    def _world(self) -> SimWorld:
        return cast(SimWorld, self._loop.world)

    def _reset(self, request: ResetTask.Request, response: ResetTask.Response) -> ResetTask.Response:
        try:
            task = self._loop.call(lambda: self._reset_now(request))
        except SimBridgeError as error:
            response.success, response.message = False, str(error)
            self._logger.warning(f"reset refused: {error}")
            return response
        response.success, response.instruction, response.max_steps = True, task.instruction, task.max_steps
        response.message = f"{task.name} {task.split.value} {request.seed}"
        self._logger.info(f"scene: {response.message}: {task.instruction}")
        return response

    def _reset_now(self, request: ResetTask.Request) -> Task:
        present = self._task
        name = request.task or (present.name if present else "")
        split = request.split or (present.split.value if present else "")
        try:
            task = reset_scene(self._world, name, split, request.seed, request.instruction)
        except (LayoutError, PhysicsError):  # the old scene is gone by then
            self._task = None
            raise
        self._loop.arm.reset("the world was reset")
        self._loop.gripper.reset("the world was reset")
        self._task, self._seed, self._was_away = task, request.seed, False
        return task

    def _watch(self, time: float, state: ArmState) -> None:
        """Judge the scene after an action: when the arm has been away and is home, and everything rests."""
        if np.abs(state.positions - ROBOT.ready).max() > _HOME_TOLERANCE:
            self._was_away = True
        elif self._was_away and all(thing.fixed or self._world.is_still(thing) for thing in self._world.objects):
            self._judge()

    def _judge(self) -> None:
        """Judge the scene once for each action: goals that are fulfilled without one do not count yet."""
        at_home = np.abs(self._world.panda.state().positions - ROBOT.ready).max() <= _HOME_TOLERANCE
        if self._task is not None and self._was_away and at_home and self._loop.arm.active is None:
            self._was_away = False
            self._task.advance()

    def _score(self, request: GetScore.Request, response: GetScore.Response) -> GetScore.Response:
        try:
            response.score, response.done, response.instruction = self._loop.call(self._score_now)
            task = self._present()
        except SimBridgeError as error:
            response.success, response.message = False, str(error)
            return response
        response.success, response.task, response.split, response.seed = (
            True,
            task.name,
            task.split.value,
            self._seed,
        )
        return response

    def _score_now(self) -> tuple[float, bool, str]:
        """Return the last action's score, done and sentence; while the arm is away
        nothing is judged: what it carries may only pass by."""
        task = self._present()
        self._judge()
        return float(task.score()), bool(task.done()), task.instruction

    def _present(self) -> Task:
        if self._task is None:
            raise SimulationError("there is no scene; call the reset service first")
        return self._task
