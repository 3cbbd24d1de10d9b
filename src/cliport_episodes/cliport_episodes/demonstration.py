"""One step of a demonstration: what was chosen on the picture, what was asked of the arm, and how it ended."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import IntEnum

from cliport_episodes.errors import RecordError
from cliport_perception.pose import PlanarPose
from cliport_perception.primitive import Outcome, Primitive


class Source(IntEnum):
    """Who chose the step. Values as in the Demonstration message."""

    CLICKED = 0
    CORRECTED = 1  # began as the policy's proposal and was changed
    PROPOSED = 2  # the policy's proposal as it was
    EXPERT = 3  # a scripted expert's


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

    step: counted from 0 as recorded. stamp_ns, frame_id: of the images that it was chosen on, and of the poses.
    pick_rotation, place_rotation: bins of 2 pi / n_rotations. executed: False where the arm was not moved; then
    outcome (as in the PickPlace action), message, grasp_centroid (x, y, z) [m] and gripper_width [m] do not count.

    Raises:
        RecordError: for a rotation that is no bin, or a number that is not finite.
    """

    step: int
    stamp_ns: int
    frame_id: str
    instruction: str
    primitive: Primitive
    source: Source
    pick_box: PixelBox | None
    place_box: PixelBox | None
    pick_rotation: int
    place_rotation: int
    n_rotations: int
    pick: PlanarPose
    place: PlanarPose
    executed: bool
    outcome: int
    message: str
    grasp_centroid: tuple[float, float, float] | None
    gripper_width: float

    def __post_init__(self) -> None:
        for name in ("pick_rotation", "place_rotation"):
            if not 0 <= getattr(self, name) < self.n_rotations:
                raise RecordError(f"{name} is {getattr(self, name)}: it must be one of 0..{self.n_rotations - 1}")
        poses = (getattr(pose, name) for pose in (self.pick, self.place) for name in ("x", "y", "yaw"))
        if not all(map(math.isfinite, (*poses, *(self.grasp_centroid or ()), self.gripper_width))):
            raise RecordError(f"step {self.step} has a pose or a measurement that is not a finite number")

    @property
    def ending(self) -> str:
        """How it ended, in words."""
        if not self.executed:
            return "recorded without moving"
        known = self.outcome in Outcome._value2member_map_
        words = Outcome(self.outcome).name.lower().replace("_", " ") if known else f"outcome {self.outcome}"
        return f"{words}: {self.message}" if self.message else words
