"""A plan's motions, drawn for people who are to approve it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from panda_executor.hand_geometry import HandShape
from panda_executor.model import PandaModel
from panda_executor.motions import Motion
from panda_executor.obstacle_grid import ObstacleGrid
from panda_executor.phase import Phase
from panda_executor.trajectory import JointTrajectory
from panda_model.limits import FloatArray

_THINNED = 4  # one point of so many is shown
_SWEPT_STEP = 0.06  # of the tcp between two hands that are shown [m]
_PIXELS = 4  # of the picture to a cell's edge
_TALL = 0.3  # a column of this height is white [m]
_PATH, _HAND = (255, 160, 40), (80, 200, 255)  # RGB


@dataclass(frozen=True, eq=False)
class PreviewPath:
    """One motion's way: poses of the tcp, (N, 3, 3) and (N, 3) [m, base frame], and the hand that goes it."""

    phase: Phase
    rotations: FloatArray
    positions: FloatArray
    hand: HandShape

    def hands(self) -> npt.NDArray[np.intp]:
        """Return which of the poses to show a hand at: the ends, and others 6 cm or so apart."""
        travelled = np.concatenate([[0.0], np.linalg.norm(np.diff(self.positions, axis=0), axis=1).cumsum()])
        steps = max(int(np.ceil(travelled[-1] / _SWEPT_STEP)), 1)
        wanted = np.linspace(0.0, travelled[-1], steps + 1)
        return np.unique(np.searchsorted(travelled, wanted - 1e-9))


def joined(motions: Sequence[Motion]) -> JointTrajectory:
    """Return all motions one after the other; the fingers' own times between them are left out."""
    parts, begin = [], 0.0
    for number, motion in enumerate(motions):
        points = slice(1 if number else 0, None)  # a motion begins where the one before it ended
        trajectory = motion.trajectory
        parts.append(
            (
                trajectory.times[points] + begin,
                trajectory.positions[points],
                trajectory.velocities[points],
                trajectory.accelerations[points],
            )
        )
        begin += trajectory.duration
    times, positions, velocities, accelerations = (np.concatenate(part) for part in zip(*parts, strict=True))
    return JointTrajectory(motions[0].trajectory.joint_names, times, positions, velocities, accelerations)


def paths(model: PandaModel, motions: Sequence[Motion]) -> list[PreviewPath]:
    """Return the way of each motion."""
    found = []
    for motion in motions:
        rows = np.concatenate([motion.trajectory.positions[:-1:_THINNED], motion.trajectory.positions[-1:]])
        poses = [model.tcp_arrays(row) for row in rows]
        rotations, positions = (np.array(part) for part in zip(*poses, strict=True))
        found.append(PreviewPath(motion.phase, rotations, positions, motion.scene.hand))
    return found


def picture(grid: ObstacleGrid, ways: Sequence[PreviewPath]) -> npt.NDArray[np.uint8]:
    """Return an RGB picture (H, W, 3) from above: things the lighter the higher, the tcp's way, the hand at its ends.

    Four pixels a cell; x of the base grows to the right, y downwards, as in the heightmap.
    """
    shade = np.clip(np.maximum(grid.heights, 0.0) / _TALL, 0.0, 1.0)
    grey = (40.0 + 200.0 * np.sqrt(shade)).astype(np.uint8)
    big = np.repeat(np.repeat(grey, _PIXELS, axis=0), _PIXELS, axis=1)
    big = np.ascontiguousarray(np.stack([big] * 3, axis=-1))
    scale = _PIXELS / grid.cell
    for way in ways:
        line = np.round((way.positions[:, :2] - (grid.x_min, grid.y_min)) * scale).astype(np.int32)
        cv2.polylines(big, [line], isClosed=False, color=_PATH, thickness=2, lineType=cv2.LINE_AA)
        if way.phase in (Phase.DESCEND, Phase.LOWER):
            under = way.hand.points @ way.rotations[-1].T + way.positions[-1]
            marks = np.round((under[:, :2] - (grid.x_min, grid.y_min)) * scale).astype(np.int32)
            cv2.drawContours(big, [cv2.convexHull(marks)], -1, _HAND, 2, cv2.LINE_AA)
    return big
