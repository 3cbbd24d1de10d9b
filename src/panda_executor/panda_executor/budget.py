"""The time that planning may take, and the stop that ends it earlier."""

from __future__ import annotations

import math
import time
from collections.abc import Callable

from panda_executor.errors import BudgetSpentError
from panda_executor.ports import ShouldStop


class Budget:
    """One bound for all of a request's planning, across grasps, branches and searches.

    Args:
        seconds: from now on; clock: steady time [s]; should_stop: ends the planning when it turns true.
    """

    def __init__(
        self,
        seconds: float = math.inf,
        clock: Callable[[], float] = time.monotonic,
        should_stop: ShouldStop = lambda: False,
    ) -> None:
        self._seconds, self._clock, self._should_stop = seconds, clock, should_stop
        self._deadline = clock() + seconds

    def is_spent(self) -> bool:
        """Return True once planning has to end; to be asked often."""
        return self._should_stop() or self._clock() > self._deadline

    def check(self, reason: str = "") -> None:
        """Check that planning may go on.

        Args:
            reason: why nothing was found so far.

        Raises:
            BudgetSpentError: when it may not.
        """
        why = f"; {reason}" if reason else ""
        if self._should_stop():
            raise BudgetSpentError(f"planning was stopped{why}")
        if self._clock() > self._deadline:
            raise BudgetSpentError(f"planning took too long (at most {self._seconds:g} s); raise planning_time{why}")
