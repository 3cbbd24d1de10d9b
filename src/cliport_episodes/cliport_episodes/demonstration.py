"""One step of a demonstration: the boxes on the picture, the action, and its result."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import IntEnum

from cliport_core.action import PickPlaceAction
from cliport_core.outcome import ActionResult
from cliport_episodes.errors import RecordError

NOT_MOVED = "recorded without moving"  # in place of an outcome


class Source(IntEnum):
    """Origin of a step: a person, the policy or both. Values as in the Demonstration message."""

    CLICKED = 0
    CORRECTED = 1  # began as the policy's proposal and was changed
    PROPOSED = 2  # the policy's unchanged proposal
    EXPERT = 3  # chosen by a scripted expert


@dataclass(frozen=True)
class PixelBox:
    """Rows [top, bottom) and columns [left, right) of the colour image.

    Raises:
        RecordError: when it holds no pixel.
    """

    top: int
    left: int
    bottom: int
    right: int

    def __post_init__(self) -> None:
        if not (0 <= self.top < self.bottom and 0 <= self.left < self.right):
            raise RecordError(
                f"box of rows {self.top}..{self.bottom}, columns {self.left}..{self.right} holds no pixel: draw it anew"
            )


@dataclass(frozen=True)
class StepRecord:
    """A step as the Demonstration message holds it.

    step: counted from 0 as recorded. stamp_ns: of the images on which it was chosen [ns]; frame_id: of the poses.
    pick_rotation, place_rotation: bins of 2 pi / n_rotations. result: how the action ended; None where the arm was
    not moved. The action's confidence is not recorded.

    Raises:
        RecordError: when a rotation is no bin, or a number is not finite.
    """

    step: int
    stamp_ns: int
    frame_id: str
    instruction: str
    source: Source
    pick_box: PixelBox | None
    place_box: PixelBox | None
    pick_rotation: int
    place_rotation: int
    n_rotations: int
    action: PickPlaceAction
    result: ActionResult | None

    def __post_init__(self) -> None:
        for name in ("pick_rotation", "place_rotation"):
            if not 0 <= getattr(self, name) < self.n_rotations:
                raise RecordError(f"{name} is {getattr(self, name)}: it must be one of 0..{self.n_rotations - 1}")
        measured: list[float] = []
        if self.result is not None:
            measured = [*(self.result.grasp_centroid or ()), self.result.gripper_width]
        poses_finite = self.action.pick.is_finite() and self.action.place.is_finite()
        if not (poses_finite and all(map(math.isfinite, measured))):
            raise RecordError(f"step {self.step} has a pose or a measurement that is not a finite number")

    @property
    def ending(self) -> str:
        """Result in words."""
        if self.result is None:
            return NOT_MOVED
        words = self.result.outcome.label
        return f"{words}: {self.result.message}" if self.result.message else words
