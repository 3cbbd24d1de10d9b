"""What a policy answers: where to pick, where to place, and how sure it is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cliport_perception.pose import PlanarPose


@dataclass(frozen=True)
class AffordanceMaps:
    """Scores over the workspace's pixels, for people to look at.

    pick: (rows, cols) float32, sums to 1 (the null action's share left out before normalising).
    place: (rows, cols) float32, the maximum over rotations, normalised to sum 1.
    """

    pick: NDArray[np.float32]
    place: NDArray[np.float32]


@dataclass(frozen=True)
class PickPlaceAction:
    """One pick and one place in the base frame, yaw about +z; place.yaw = pick.yaw + the chosen relative rotation.

    Pixels are (row, col) on the workspace grid. Confidences are the probability mass within
    a 3 cm disc around the chosen pixel, whatever the rotation, in [0, 1]. done_probability is the null action's share:
    how likely it is that nothing remains to be done for the instruction.
    """

    pick: PlanarPose
    place: PlanarPose
    pick_pixel: tuple[int, int]
    place_pixel: tuple[int, int]
    pick_confidence: float
    place_confidence: float
    done_probability: float
    maps: AffordanceMaps | None = None

    @property
    def confidence(self) -> float:
        """Of the whole: the lesser of the two."""
        return min(self.pick_confidence, self.place_confidence)


@dataclass(frozen=True)
class Explanation:
    """An action with its maps, and what was thought of the rotations, bin i standing for i * 360 / k degrees.

    yaws: (k,) float32, probability of each gripper yaw at the pick; None for a network without a rotator.
    rotations: (k,) float32, probability of each rotation from pick to place, over all places.
    """

    action: PickPlaceAction
    yaws: NDArray[np.float32] | None
    rotations: NDArray[np.float32]
