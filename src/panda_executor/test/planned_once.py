"""A planner for tests of what becomes of a plan, which are many and begin with the same few plans."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from cliport_core.action import PickPlaceAction
from cliport_core.workspace import WorkspaceSpec
from panda_executor.config import ExecutorConfig
from panda_executor.model import PandaModel
from panda_executor.phase import Phase
from panda_executor.ports import ShouldStop
from panda_executor.transfer import TransferPlanner
from panda_executor.transfer_attempts import PickPlacePlan
from panda_model import FloatArray

Request = tuple[PickPlaceAction, bytes, WorkspaceSpec, bytes]


class PlannedOnce(TransferPlanner):
    """Plans a pick and place once, says the same when it is asked again, and can still be stopped then.

    The fake arm keeps copies of what it is sent, so that no test changes a plan that another one is given.
    """

    def __init__(self, model: PandaModel, config: ExecutorConfig) -> None:
        super().__init__(model, config)
        self._known: dict[Request, tuple[PickPlacePlan, list[tuple[Phase, float]]]] = {}

    def plan(
        self,
        action: PickPlaceAction,
        cloud: npt.NDArray[np.float32],
        workspace: WorkspaceSpec,
        start: FloatArray,
        on_phase: Callable[[Phase, float], None] = lambda phase, progress: None,
        should_stop: ShouldStop = lambda: False,
    ) -> PickPlacePlan:
        """Return the plan; arguments and errors as those of `TransferPlanner.plan`."""
        request = action, cloud.tobytes(), workspace, start.tobytes()
        if request not in self._known:
            said: list[tuple[Phase, float]] = []

            def say(phase: Phase, share: float) -> None:
                said.append((phase, share))
                on_phase(phase, share)

            self._known[request] = super().plan(action, cloud, workspace, start, say, should_stop), said
            return self._known[request][0]
        plan, (*before, last) = self._known[request]
        for phase, share in before:
            on_phase(phase, share)
        self.budget(should_stop).check()
        on_phase(*last)
        return plan
