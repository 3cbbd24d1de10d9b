"""Activities of the station, and the hooks by which they reach its other parts."""

from __future__ import annotations

from collections.abc import Callable
from enum import Enum
from typing import NamedTuple

from demo_tool.motion_film import MotionFilm


class Activity(Enum):
    """Present activity of the station; the values are the page's."""

    NONE = "ready"
    PLANNING = "planning"
    EXECUTING = "executing"
    RECORDING = "recording"
    PROPOSING = "proposing"
    WAITING = "waiting_for_approval"
    RECOVERING = "recovering"

    @property
    def words(self) -> str:
        """The activity in words."""
        return self.value.replace("_", " ")


class StationHooks(NamedTuple):
    """Functions of the station that its work calls.

    on_recorded: called after a step was recorded. on_rest: called after the arm moved.
    policy_moves: returns True while the policy server has the arm.
    is_home: returns True or False as the arm was measured at its ready pose or elsewhere, None while that is not known.
    film: of the motion, for the step that is recorded.
    """

    on_recorded: Callable[[], None]
    on_rest: Callable[[], None]
    policy_moves: Callable[[], bool]
    is_home: Callable[[], bool | None]
    film: MotionFilm
