"""How far a policy's pick and place are from what was recorded: pixels, millimetres, degrees."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from statistics import median
from typing import Any

from cliport_perception.heightmap import Heightmap
from cliport_perception.pose import PlanarPose
from cliport_perception.workspace import WorkspaceSpec
from cliport_policy.action import PickPlaceAction
from cliport_policy.errors import InstructionError
from cliport_policy.policy import Policy

NEAR_MM = 20.0  # half a block: nearer than this the same thing is meant
_HALF_TURN, _FULL_TURN = 180.0, 360.0


@dataclass(frozen=True, eq=False)
class RecordedStep:
    """What was seen, said and done; source: which episode or bag it is from, step: which of it."""

    source: str
    step: int
    stamp_ns: int
    heightmap: Heightmap
    instruction: str
    pick: PlanarPose
    place: PlanarPose


@dataclass
class Span:
    """From the first to the last moment of something."""

    first_ns: int | None = None
    last_ns: int = 0

    def add(self, stamp_ns: int) -> None:
        """A moment of it [ns]."""
        self.first_ns = stamp_ns if self.first_ns is None else min(self.first_ns, stamp_ns)
        self.last_ns = max(self.last_ns, stamp_ns)

    @property
    def seconds(self) -> float:
        """How long it is."""
        return 0.0 if self.first_ns is None else 1e-9 * (self.last_ns - self.first_ns)


@dataclass(frozen=True)
class Errors:
    """Of a prediction. pick_deg: of the jaws, for which half a turn is none, 0..90; turn_deg: of the turn from pick to
    place, 0..180."""

    pick_px: float
    pick_mm: float
    pick_deg: float
    place_px: float
    place_mm: float
    turn_deg: float

    @property
    def worst_mm(self) -> float:
        """The greater of the two distances."""
        return max(self.pick_mm, self.place_mm)


@dataclass(frozen=True)
class Comparison:
    """A recorded step and what the policy says of it; refused: why it says nothing. Poses are (x, y [m], yaw [rad])."""

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
        """Plain values, ready for JSON."""
        return asdict(self)


def compare(policy: Policy, step: RecordedStep) -> Comparison:
    """Ask a policy about a recorded step. Raises ObservationError where the step's workspace is not the policy's."""
    known = (step.source, step.step, step.stamp_ns, step.instruction, _rounded(step.pick), _rounded(step.place))
    try:
        action = policy.infer(step.heightmap, step.instruction)
    except InstructionError as refusal:
        return Comparison(*known, refused=str(refusal))
    return Comparison(
        *known,
        _rounded(action.pick),
        _rounded(action.place),
        errors_of(action, step.pick, step.place, step.heightmap.workspace),
        round(action.pick_confidence, 4),
        round(action.place_confidence, 4),
        round(action.done_probability, 4),
    )


def errors_of(action: PickPlaceAction, pick: PlanarPose, place: PlanarPose, workspace: WorkspaceSpec) -> Errors:
    """Of an action against what was recorded."""
    pick_mm, place_mm = _distance_mm(action.pick, pick), _distance_mm(action.place, place)
    pixel_mm = 1000.0 * workspace.pixel_size
    turn = (action.place.yaw - action.pick.yaw) - (place.yaw - pick.yaw)
    return Errors(
        round(pick_mm / pixel_mm, 2),
        round(pick_mm, 2),
        round(_angle_deg(action.pick.yaw - pick.yaw, _HALF_TURN), 2),
        round(place_mm / pixel_mm, 2),
        round(place_mm, 2),
        round(_angle_deg(turn, _FULL_TURN), 2),
    )


def summarize(comparisons: Sequence[Comparison]) -> dict[str, Any]:
    """Medians, the value that nine in ten stay below, and how often both ends are meant; refused steps miss both."""
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
    """Of a difference [rad], where turning by `period` degrees is nothing."""
    return abs(math.remainder(math.degrees(difference), period))


def _rounded(pose: PlanarPose) -> tuple[float, float, float]:
    return round(pose.x, 4), round(pose.y, 4), round(math.remainder(pose.yaw, math.tau), 4)
