"""What the station needs of an arm and of a policy; the graph's, or a test's."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from cliport_perception.pose import PlanarPose
from cliport_perception.primitive import Outcome, Primitive


@dataclass(frozen=True)
class PickPlaceGoal:
    """What is asked of the arm: poses in the base frame [m, rad], chosen on the picture of stamp_ns [ns, ROS time].

    With plan_only nothing moves.
    """

    pick: PlanarPose
    place: PlanarPose
    primitive: Primitive
    instruction: str
    stamp_ns: int
    plan_only: bool = False


@dataclass(frozen=True)
class ArmResult:
    """The end of a goal: one line of message; centroid [m, base frame] and finger width [m] of the grasp."""

    outcome: Outcome
    message: str
    grasp_centroid: tuple[float, float, float] | None = None
    gripper_width: float = 0.0


OnPhase = Callable[[str, float], None]  # the phase's name, as the executor gives it, and the share done
OnEnd = Callable[[ArmResult], None]

ACCEPTED = "ACCEPTED"  # the phase that an arm reports when it has taken a goal
RESTING = frozenset({ACCEPTED, "VALIDATING", "GRASP_PLANNING"})  # phases in which nothing moves yet


class Arm(Protocol):
    """The executor. No method waits; answers come by the callbacks, from any thread."""

    def fault(self) -> str | None:
        """Why it cannot be asked for anything now, in one line, or None."""

    def send(self, goal: PickPlaceGoal, on_phase: OnPhase, on_end: OnEnd) -> None:
        """Begin a goal. The first phase is ACCEPTED; a refusal ends it with Outcome.REJECTED."""

    def cancel(self) -> None:
        """Ask for the end of the goal that runs, if one does."""

    def stop(self, reason: str) -> None:
        """Cancel, and let nothing move, whoever asks for it, until `resume`."""

    def resume(self) -> None:
        """End a stop."""


class Policy(Protocol):
    """The policy server. No method waits; what it does comes to the station by `on_policy_status` and `..._pose`."""

    def ask_whether_it_waits(self, on_answer: Callable[[bool | None], None]) -> None:
        """Whether it waits for a person's approval before the arm moves; None: it does not answer."""

    def instruct(self, text: str) -> None:
        """Give it a goal in words; an empty one makes it drop what it has."""
