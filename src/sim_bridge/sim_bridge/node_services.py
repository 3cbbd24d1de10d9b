"""Services of the simulator: make a scene, read its score."""

from __future__ import annotations

from typing import TYPE_CHECKING, cast

from rclpy.callback_groups import MutuallyExclusiveCallbackGroup

from cliport_interfaces.srv import GetScore, ResetTask
from sim_bridge.errors import SimBridgeError, SimulationError
from sim_bridge.sim_loop import SimLoop
from sim_bridge.task_mechanics.base import Task
from sim_bridge.world import SimWorld

if TYPE_CHECKING:
    from rclpy.node import Node


class SceneServices:
    """Serves `~/reset` and `~/score`. An empty task or split in a request keeps the present one."""

    def __init__(self, node: Node, loop: SimLoop, seed: int) -> None:
        self._loop = loop
        self._seed = seed
        self._logger = node.get_logger()
        group = MutuallyExclusiveCallbackGroup()
        node.create_service(ResetTask, "~/reset", self._reset, callback_group=group)
        node.create_service(GetScore, "~/score", self._score, callback_group=group)

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
        world = cast(SimWorld, self._loop.world)
        present = world.task
        name = request.task or (present.name if present else "")
        split = request.split or (present.split.value if present else "")
        task = world.reset(name, split, request.seed, request.instruction)
        self._loop.arm.reset("the world was reset")
        self._loop.gripper.reset("the world was reset")
        self._seed = request.seed
        return task

    def _score(self, request: GetScore.Request, response: GetScore.Response) -> GetScore.Response:
        try:
            response.score, response.done, response.instruction = self._loop.call(self._score_now)
            task = self._task()
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
        """Nothing is judged to be reached while the arm moves: what it carries may only pass by."""
        task = self._task()
        if self._loop.arm.active is None:
            task.advance()
        return float(task.score()), bool(task.done()), task.instruction

    def _task(self) -> Task:
        task = cast(SimWorld, self._loop.world).task
        if task is None:
            raise SimulationError("there is no scene; call the reset service first")
        return task
