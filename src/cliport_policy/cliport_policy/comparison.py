"""Distances of a policy's pick and place from what was recorded, in pixels, millimetres and degrees."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from statistics import median
from typing import Any

from cliport_core.action import PickPlaceAction
from cliport_core.heightmap import Heightmap
from cliport_core.pose import PlanarPose
from cliport_core.workspace import WorkspaceSpec
from cliport_policy.errors import InstructionError
from cliport_policy.policy import Policy

NEAR_MM = 20.0  # half a block: nearer than this the same thing is meant
_HALF_TURN, _FULL_TURN = 180.0, 360.0


@dataclass(frozen=True, eq=False)
class RecordedStep:
    """Recorded observation, sentence and action.

    source: name of the episode or bag; step: its number in it.
    """

    source: str
    step: int
    stamp_ns: int
    heightmap: Heightmap
    instruction: str
    action: PickPlaceAction


@dataclass
class Span:
    """Time from the first to the last of several moments."""

    first_ns: int | None = None
    last_ns: int = 0

    def add(self, stamp_ns: int) -> None:
        """Extend the span to a moment [ns]."""
        self.first_ns = stamp_ns if self.first_ns is None else min(self.first_ns, stamp_ns)
        self.last_ns = max(self.last_ns, stamp_ns)

    @property
    def seconds(self) -> float:
        """Length of the span [s]."""
        return 0.0 if self.first_ns is None else 1e-9 * (self.last_ns - self.first_ns)


@dataclass(frozen=True)
class Errors:
    """Distances of a prediction from what was recorded.

    pick_deg: angle between the jaws, 0..90; half a turn makes no difference.
    turn_deg: difference of the turns from pick to place, 0..180.
    """

    pick_px: float
    pick_mm: float
    pick_deg: float
    place_px: float
    place_mm: float
    turn_deg: float

    @property
    def worst_mm(self) -> float:
        """Greater of the two distances."""
        return max(self.pick_mm, self.place_mm)


@dataclass(frozen=True)
class Comparison:
    """Recorded step beside the policy's answer. Poses are (x, y [m], yaw [rad]).

    refused: the reason, if the policy refused the sentence.
    """

    source: str
    step: int
    stamp_ns: int
    instruction: str
    recorded_pick: tuple[float, float, float]
    recorded_place: tuple[float, float, float]
    predicted_pick: tuple[float, float, float] | None = None
    predicted_place: tuple[float, float, float] | None = None
    errors: Errors | None = None
    pick_confidence: float | None = None
    place_confidence: float | None = None
    done_probability: float | None = None
    refused: str = ""

    def to_dict(self) -> dict[str, Any]:
        """Return plain values, ready for JSON."""
        return asdict(self)


def compare(policy: Policy, step: RecordedStep) -> Comparison:
    """Ask a policy about a recorded step.

    Raises:
        ObservationError: if the step's workspace is not the policy's.
    """
    recorded = step.action
    known = Comparison(
        source=step.source,
        step=step.step,
        stamp_ns=step.stamp_ns,
        instruction=step.instruction,
        recorded_pick=_rounded(recorded.pick),
        recorded_place=_rounded(recorded.place),
    )
    try:
        inference = policy.infer(step.heightmap, step.instruction)
    except InstructionError as refusal:
        return replace(known, refused=str(refusal))
    return replace(
        known,
        predicted_pick=_rounded(inference.action.pick),
        predicted_place=_rounded(inference.action.place),
        errors=action_errors(inference.action, recorded, step.heightmap.workspace),
        pick_confidence=round(inference.pick_confidence, 4),
        place_confidence=round(inference.place_confidence, 4),
        done_probability=round(inference.done_probability, 4),
    )


def action_errors(action: PickPlaceAction, recorded: PickPlaceAction, workspace: WorkspaceSpec) -> Errors:
    """Return the distances of an action from the recorded one."""
    pick_mm, place_mm = _distance_mm(action.pick, recorded.pick), _distance_mm(action.place, recorded.place)
    pixel_mm = 1000.0 * workspace.pixel_size
    turn = (action.place.yaw - action.pick.yaw) - (recorded.place.yaw - recorded.pick.yaw)
    return Errors(
        round(pick_mm / pixel_mm, 2),
        round(pick_mm, 2),
        round(_angle_deg(action.pick.yaw - recorded.pick.yaw, _HALF_TURN), 2),
        round(place_mm / pixel_mm, 2),
        round(place_mm, 2),
        round(_angle_deg(turn, _FULL_TURN), 2),
    )


def summarize(comparisons: Sequence[Comparison]) -> dict[str, Any]:
    """Return medians, ninth deciles and the shares of steps within NEAR_MM; a refused step counts as a miss."""
    found = [c.errors for c in comparisons if c.errors is not None]
    summary: dict[str, Any] = {"steps": len(comparisons), "refused": len(comparisons) - len(found)}
    for name in Errors.__dataclass_fields__:
        values = sorted(getattr(errors, name) for errors in found)
        if values:
            nine_in_ten = values[math.ceil(0.9 * len(values)) - 1]
            summary[name] = {"median": round(median(values), 2), "nine_in_ten": nine_in_ten, "worst": values[-1]}
    for name in ("pick_mm", "place_mm", "worst_mm"):
        near = sum(getattr(errors, name) <= NEAR_MM for errors in found)
        summary[f"{name.removesuffix('_mm').replace('worst', 'both')}_within_{NEAR_MM:.0f}_mm"] = _share(
            near, len(comparisons)
        )
    return summary


def _share(count: int, total: int) -> float:
    return round(count / total, 4) if total else 0.0


def _distance_mm(a: PlanarPose, b: PlanarPose) -> float:
    return 1000.0 * math.hypot(a.x - b.x, a.y - b.y)


def _angle_deg(difference: float, period: float) -> float:
    """Return the size [degrees] of a difference [rad] between angles that repeat after `period` degrees."""
    return abs(math.remainder(math.degrees(difference), period))


def _rounded(pose: PlanarPose) -> tuple[float, float, float]:
    return round(pose.x, 4), round(pose.y, 4), round(math.remainder(pose.yaw, math.tau), 4)
