"""One motion of the hand to a pose in space, from validation to its end."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from cliport_core.action import HandGoal
from cliport_core.outcome import ActionResult, Outcome, Refusal
from cliport_core.workspace import WorkspaceSpec
from panda_executor.errors import (
    BudgetSpentError,
    ExecutorError,
    InverseKinematicsError,
    PlanningError,
    RequestError,
)
from panda_executor.hand_geometry import HandShape, HeldObject
from panda_executor.motions import Motion
from panda_executor.obstacle_grid import ObstacleGrid
from panda_executor.phase import Phase
from panda_executor.request_check import check_cloud, check_positions, check_table
from panda_executor.run_commands import EarlyEnd, RunCommands
from panda_executor.run_end import ended, result_of
from panda_executor.transfer import TransferPlanner
from panda_model.limits import FloatArray

Cloud = npt.NDArray[np.float32]
_MOST_CARRIED = 0.3  # from the tcp [m]: more would touch the arm in every pose
_CELL = 0.004  # of the round thing that stands for what is carried [m]


class HandMove:
    """The state of one goal of the hand, and the order of its steps.

    Args:
        cloud_source: fetches a cloud (N, 3) [m, base frame], None where the motion is to be blind.
    """

    def __init__(
        self,
        planner: TransferPlanner,
        commands: RunCommands,
        goal: HandGoal,
        cloud_source: Callable[[], Cloud | None],
        workspace: WorkspaceSpec,
    ) -> None:
        self._planner, self._commands, self._goal = planner, commands, goal
        self._cloud_source, self._workspace = cloud_source, workspace

    def result(self) -> ActionResult:
        """Run the goal to its end; after a failure the arm stays where it is."""
        success = Outcome.PLANNED if self._goal.plan_only else Outcome.SUCCEEDED
        return ended(self._commands, self._sequence, success, self._stopped)

    def _stopped(self, end: EarlyEnd) -> ActionResult:
        return result_of(self._commands, end.outcome, str(end))

    def _sequence(self) -> str:
        commands = self._commands
        commands.enter(Phase.VALIDATING)
        if self._goal.carried > _MOST_CARRIED:
            words = f"carried is {self._goal.carried:g} m, at most {_MOST_CARRIED:g}: in metres from the tcp"
            raise RequestError(words, Refusal.MALFORMED, self._goal.carried, _MOST_CARRIED)
        start = commands.positions()
        check_positions(start)
        grid = self._grid(start)
        commands.enter(Phase.GRASP_PLANNING)
        motion = self._planned(start, grid)
        if commands.offer([motion]):
            motion = self._among_new(motion)
        if self._goal.plan_only:
            return "planned a motion of the hand; nothing moved"
        commands.move(motion)
        commands.enter(Phase.DONE)
        return "the hand is there"

    def _grid(self, positions: FloatArray) -> ObstacleGrid:
        """Return the columns of what is seen, without the arm's own at `positions` (7,) [rad]."""
        cloud = self._cloud_source()
        if cloud is None:
            cloud = np.full((1, 3), np.nan, dtype=np.float32)
        else:
            check_cloud(cloud)
            config = self._planner.config
            check_table(cloud, self._workspace, config.scene.table_z, config.table)
        return self._planner.grid(cloud, self._workspace, positions)

    def _planned(self, start: FloatArray, grid: ObstacleGrid) -> Motion:
        """Plan the way to the nearest configuration to which there is one.

        Raises:
            RequestError: when the target is out of reach.
            PlanningError: when there is no way.
        """
        target = self._goal.target
        motions = self._planner.motions_within(self._planner.budget(self._commands.should_stop))
        scene = self._planner.scene(grid, self._hand()).escaping(start)
        try:
            solutions = self._planner.ik.solve_all(target, start)
        except InverseKinematicsError as error:
            x, y, z = target.translation
            words = f"({x:.3f}, {y:.3f}, {z:.3f}) m is out of reach with the hand turned as asked"
            raise RequestError(words, Refusal.OUT_OF_REACH, error.residual) from None
        reason = ""
        for solution in solutions:
            try:
                return motions.travel(Phase.CARRY, start, solution.positions, scene)
            except BudgetSpentError:
                raise
            except PlanningError as error:
                reason = reason or str(error)
        raise PlanningError(reason)

    def _among_new(self, motion: Motion) -> Motion:
        """Return the motion among what is seen now: its approval took a person's time. Raises PlanningError."""
        grid = self._grid(self._commands.positions())
        try:
            return self._planner.motions.among(motion, grid)
        except ExecutorError as error:
            raise PlanningError(f"the scene changed while the plan waited for its approval: {error}") from None

    def _hand(self) -> HandShape:
        """Return the hand with a round thing as large as what it carries."""
        reach = self._goal.carried
        if reach <= 0.0:
            return self._commands.hand_shape()
        steps = np.arange(-reach, reach + _CELL, _CELL)
        cells = np.stack(np.meshgrid(steps, steps, indexing="ij"), axis=-1).reshape(-1, 2)
        cells = cells[np.linalg.norm(cells, axis=1) <= reach + _CELL]
        return HandShape(self._planner.config.hand, self._commands.width(), HeldObject(cells, reach, reach))
