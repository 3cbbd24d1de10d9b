"""The last look at the scene before the hand goes down: what came or moved while the arm was on its way."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress

import numpy as np
import numpy.typing as npt

from cliport_core.outcome import Outcome
from cliport_core.workspace import WorkspaceSpec
from panda_executor.drag import DragPlan
from panda_executor.errors import PlanningError, RequestError
from panda_executor.obstacle_grid import ObstacleGrid
from panda_executor.place_change import LaterView, drag_problem, pick_problem, place_problem, raised
from panda_executor.request_check import check_cloud
from panda_executor.run_commands import EarlyEnd, RunCommands
from panda_executor.transfer import TransferPlanner
from panda_executor.transfer_attempts import PickPlacePlan
from panda_model.limits import FloatArray

Cloud = npt.NDArray[np.float32]
Look = Callable[[], Cloud]  # a cloud from after the last departure; raises RequestError where none comes in time


class LastLook:
    """Compares what the cameras see with what a plan was made for, the arm above the object or the place.

    Its methods that look raise PlanningError where the plan does not hold any more, and EarlyEnd where no cloud came:
    the hand does not go down blindly.

    Args:
        look: fetches a cloud (N, 3) [m, base frame]; None where nothing but the arm moves: then nothing is looked at.
    """

    def __init__(
        self, planner: TransferPlanner, commands: RunCommands, workspace: WorkspaceSpec, look: Look | None
    ) -> None:
        self._planner, self._commands, self._workspace, self._look = planner, commands, workspace, look
        self._changed: Cloud | None = None  # in which not all is as planned
        self.refusal: RequestError | None = None  # why no cloud came

    def at_object(self, plan: PickPlacePlan, follow: bool) -> PickPlacePlan:
        """Return the plan for where the object is now; follow: as in `TransferPlanner.found_again`.

        Raises:
            TrajectoryError: when the way up from where the object is now does not pass.
        """
        cloud = self._seen()
        if cloud is None:
            return plan
        plan = self._planner.found_again(plan, cloud, follow)
        self._judge(pick_problem(plan, self._view(cloud), self._planner.motions))
        return plan

    def at_drag(self, plan: DragPlan) -> None:
        """Check that a drag can begin."""
        cloud = self._seen()
        if cloud is not None:
            self._judge(drag_problem(plan, self._view(cloud), self._planner.motions))

    def at_place(self, plan: PickPlacePlan) -> None:
        """Check that what is held can be let go at the place."""
        cloud = self._seen()
        if cloud is not None:
            self._judge(place_problem(plan, self._view(cloud), self._planner.motions))

    def raised(self, grid: ObstacleGrid, positions: FloatArray) -> ObstacleGrid:
        """Return the plan's columns for the way back: with what came, where a look found that something changed.

        The arm stands at `positions` (7,) [rad]. If possible it is looked at once more, now that the arm rests.
        """
        if self._look is None or self._changed is None:
            return grid
        with suppress(RequestError):
            self._changed = self._look()
        return raised(grid, self._planner.grid(self._changed, self._workspace, positions))

    def _seen(self) -> Cloud | None:
        """Return a cloud from after the departure, None where nothing is looked at. Raises EarlyEnd without one."""
        if self._look is None:
            return None
        try:
            cloud = self._look()
            check_cloud(cloud)
        except RequestError as error:
            self._commands.check_stop()
            self.refusal = error
            words = f"the scene could not be looked at again before the hand goes down: {error}"
            raise EarlyEnd(Outcome.EXECUTION_FAILED, words, may_recover=True) from None
        self._changed = cloud  # until it is judged
        return cloud

    def _view(self, cloud: Cloud) -> LaterView:
        return LaterView(cloud, self._workspace, self._commands.positions())

    def _judge(self, problem: str | None) -> None:
        if problem is not None:
            raise PlanningError(problem)
        self._changed = None
