"""Services of the simulator: make a scene, read its score."""

from __future__ import annotations

from typing import cast

import numpy as np
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.node import Node

from cliport_core import topics
from cliport_core.heap import trim_heap
from cliport_interfaces.srv import GetScore, ResetTask
from sim_bridge.errors import PhysicsError, SimBridgeError, SimulationError
from sim_bridge.panda import ArmState
from sim_bridge.robot import HOME_TOLERANCE, ROBOT
from sim_bridge.scene import reset_scene
from sim_bridge.sim_loop import SimLoop
from sim_bridge.task_mechanics.task import Task
from sim_bridge.world import SimWorld

_JUDGED_EVERY = 0.1  # that the arm may have come home [s]


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
        self._broken = False  # things flew apart in an action: nothing is judged any more
        self._home_since: float | None = None  # simulated time [s]; None while the arm is away or moves
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
        response.redraws = task.redraws
        response.message = f"{task.name} {task.split.value} {request.seed}"
        self._logger.info(f"scene: {response.message}: {task.instruction}")
        return response

    def _reset_now(self, request: ResetTask.Request) -> Task:
        present = self._task
        name = request.task or (present.name if present else "")
        split = request.split or (present.split.value if present else "")
        panda = self._world.panda
        try:
            task = reset_scene(self._world, name, split, request.seed, request.instruction)
        except Exception:
            if self._world.panda is not panda:  # the world was cleared: the old scene is gone
                self._take_scene(None)
            raise
        self._take_scene(task)
        trim_heap()
        self._seed = request.seed
        return task

    def _take_scene(self, task: Task | None) -> None:
        """Begin anew with the scene of a cleared world, whose arm is at home."""
        self._loop.arm.reset("the world was reset")
        self._loop.gripper.reset("the world was reset")
        self._task, self._was_away, self._home_since, self._broken = task, False, None, False

    def _watch(self, time: float, state: ArmState) -> None:
        """Judge the scene after an action: when the arm has been away and is home, and everything rests.

        A rope never quite rests: a scene is judged after the physics' time to settle at the latest, or when the next
        motion begins.
        """
        at_home = np.abs(state.positions - ROBOT.ready).max() <= HOME_TOLERANCE
        if at_home and self._loop.arm.active is None:
            if self._home_since is None:
                self._home_since = time
            if self._was_away and (time - self._home_since >= self._world.config.max_settle_s or self._rests()):
                self._judge()
            return
        if self._was_away and self._home_since is not None:
            self._judge()
        self._home_since = None
        self._was_away = self._was_away or not at_home

    def _rests(self) -> bool:
        return all(thing.fixed or self._world.is_still(thing) for thing in self._world.objects)

    def _judge(self) -> None:
        """Judge the scene once for each action: goals that are fulfilled without one do not count yet.

        Where things flew apart, the score that stood before stays.
        """
        self._was_away = False
        if self._task is None or self._broken:
            return
        try:
            self._world.check_intact()
        except PhysicsError as error:
            self._broken = True
            self._logger.warning(f"the scene is judged no more: {error}")
            return
        self._task.advance()

    def _score(self, request: GetScore.Request, response: GetScore.Response) -> GetScore.Response:
        try:
            response.score, response.done, response.instruction = self._loop.call(self._score_now)
            task = self._present()
        except SimBridgeError as error:
            response.success, response.message = False, str(error)
            return response
        response.success, response.broken = True, self._broken
        response.task, response.split, response.seed = task.name, task.split.value, self._seed
        return response

    def _score_now(self) -> tuple[float, bool, str]:
        """Return the last judged action's score, done and sentence; while the arm is away
        nothing is judged: what it carries may only pass by."""
        task = self._present()
        self._watch(self._world.time, self._world.panda.state())
        return float(task.score()), bool(task.done()), task.instruction

    def _present(self) -> Task:
        if self._task is None:
            raise SimulationError("there is no scene; call the reset service first")
        return self._task
