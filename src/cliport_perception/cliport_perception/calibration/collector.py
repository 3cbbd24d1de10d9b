"""The taking of samples: when the arm stands still, the board is seen well, and the pose is a new one."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from cliport_core.pose import Pose
from cliport_perception.calibration.angles import pose_difference
from cliport_perception.calibration.detection import BoardDetector, Fault, Refusal
from cliport_perception.calibration.sample import Sample
from cliport_perception.calibration.view import BoardView

_S = 1_000_000_000


@dataclass(frozen=True)
class StillConfig:
    """Conditions of a sample.

    still_s: how long the arm must have stood, within still_mm and still_deg. max_clock_s: by which stamps of picture
    and arm may differ. new_mm, new_deg: a pose must differ by one of them from all before. steady_px: by which the
    board may move from one picture to the next.
    """

    still_s: float = 0.6
    still_mm: float = 0.5
    still_deg: float = 0.1
    max_clock_s: float = 1.0
    new_mm: float = 30.0
    new_deg: float = 8.0
    steady_px: float = 0.7


class SampleCollector:
    """Turns a stream of gripper poses and pictures into samples; all times [ns] are handed in."""

    def __init__(self, detector: BoardDetector, config: StillConfig | None = None) -> None:
        self._detector = detector
        self._config = config or StillConfig()
        self._poses: deque[tuple[int, Pose]] = deque(maxlen=2000)
        self._last: tuple[int, BoardView] | None = None
        self.samples: list[Sample] = []

    @property
    def gripper_in_base(self) -> Pose | None:
        """The newest pose of the gripper."""
        return self._poses[-1][1] if self._poses else None

    def on_gripper(self, stamp_ns: int, gripper_in_base: Pose) -> None:
        """Take note of where the gripper is; a pose that is a little older than the last one is late and dropped."""
        back_ns = self._poses[-1][0] - stamp_ns if self._poses else 0
        if back_ns > self._config.max_clock_s * _S:
            self._poses.clear()  # the clock was reset
        elif back_ns > 0:
            return
        self._poses.append((stamp_ns, gripper_in_base))

    def on_picture(self, stamp_ns: int, picture: npt.NDArray[np.uint8]) -> Sample | Refusal:
        """Return the sample that a picture gives, or why it gives none.

        Raises:
            ImageError: when the picture does not have the camera's size.
        """
        pose = self._still_pose(stamp_ns)
        if isinstance(pose, Refusal):
            self._last = None
            return pose
        if self._is_known(pose):
            return Refusal(Fault.MOVING, "this pose is taken: move the hand on")
        view = self._detector.look(picture)
        if isinstance(view, Refusal):
            self._last = None
            return view
        before, self._last = self._last, (stamp_ns, view)
        if before is None:
            return Refusal(Fault.MOVING, "the board is seen: hold still for one more picture")
        moved = shift_px(before[1], view)
        if moved > self._config.steady_px:
            words = f"the board moved by {moved:.1f} px between two pictures: hold camera and board still"
            return Refusal(Fault.MOVING, words)
        self._last = None
        self.samples.append(Sample(pose, view, stamp_ns))
        return self.samples[-1]

    def _still_pose(self, stamp_ns: int) -> Pose | Refusal:
        config = self._config
        if not self._poses:
            words = "no transform joins the gripper to the base on /tf: is the arm's driver running?"
            return Refusal(Fault.NO_ARM, words)
        apart_s = (stamp_ns - self._poses[-1][0]) / _S
        if abs(apart_s) > config.max_clock_s:
            words = (
                f"the newest pose of the gripper is {abs(apart_s):.1f} s {'older' if apart_s > 0 else 'newer'} than the"
            )
            return Refusal(Fault.NO_ARM, f"{words} picture: do camera and arm have one clock, and do both still come?")
        since = min(stamp_ns, self._poses[-1][0]) - round(config.still_s * _S)
        recent = [pose for stamp, pose in self._poses if stamp >= since]
        reach_s = (self._poses[-1][0] - self._poses[0][0]) / _S
        if reach_s < config.still_s:
            return Refusal(Fault.MOVING, "the gripper's pose has come for too short a time: wait")
        for pose in recent:
            mm, deg = pose_difference(recent[-1], pose)
            if mm > config.still_mm or deg > config.still_deg:
                words = f"the arm moves ({mm:.1f} mm in {config.still_s:g} s): let it stand still"
                return Refusal(Fault.MOVING, words)
        return recent[-1]

    def _is_known(self, pose: Pose) -> bool:
        for sample in self.samples:
            mm, deg = pose_difference(sample.gripper_in_base, pose)
            if mm < self._config.new_mm and deg < self._config.new_deg:
                return True
        return False


def shift_px(first: BoardView, second: BoardView) -> float:
    """Return how far the corners that both views have moved, in the median [px]."""
    known = {tuple(point): pixel for point, pixel in zip(first.points.round(6), first.pixels)}
    shifts: Sequence[float] = [
        float(np.linalg.norm(known[tuple(point)] - pixel))
        for point, pixel in zip(second.points.round(6), second.pixels)
        if tuple(point) in known
    ]
    return float(np.median(shifts)) if shifts else math.inf
