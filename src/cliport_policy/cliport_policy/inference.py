"""Answer of a policy: an action, and how sure the policy is of it."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from cliport_core.action import PickPlaceAction


@dataclass(frozen=True, eq=False)
class AffordanceMaps:
    """Scores over the workspace's pixels, for people to look at.

    pick: (rows, cols) float32, sums to 1 (the null action's share left out before normalising).
    place: (rows, cols) float32, the maximum over rotations, normalised to sum 1.
    """

    pick: NDArray[np.float32]
    place: NDArray[np.float32]


class NullAction(Enum):
    """Reason to do nothing."""

    DONE = "done"  # nothing remains to be done for the instruction
    ABSENT = "not here"  # what it names is not to be seen


@dataclass(frozen=True)
class Inference:
    """The action that a policy chose, and what it was chosen from.

    action: place.yaw = pick.yaw + the chosen relative rotation; its confidence is the lesser of the two here.
    Pixels are (row, col) on the workspace grid. Confidences are the probability mass within
    a 3 cm disc around the chosen pixel, whatever the rotation, in [0, 1]. The null actions' shares: done_probability,
    how likely it is that nothing remains to be done for the instruction, shifted by the card's done_bias;
    absent_probability, how likely that what it names is not to be seen, 0 for a network that does not tell these
    apart. missing: what is not to be seen, such as "purple bowl", "" if that can't be told.
    """

    action: PickPlaceAction
    pick_pixel: tuple[int, int]
    place_pixel: tuple[int, int]
    pick_confidence: float
    place_confidence: float
    done_probability: float
    maps: AffordanceMaps | None = None
    absent_probability: float = 0.0
    missing: str = ""

    @property
    def confidence(self) -> float:
        """Lesser confidence of pick and place."""
        return min(self.pick_confidence, self.place_confidence)

    def null_action(self, done_threshold: float, absent_threshold: float) -> NullAction | None:
        """Return why nothing is to be done, each reason from its threshold of probability on; None for an action.

        Of both the likelier one.
        """
        reasons = (
            (self.done_probability, done_threshold, NullAction.DONE),
            (self.absent_probability, absent_threshold, NullAction.ABSENT),
        )
        heard = [(probability, reason) for probability, threshold, reason in reasons if probability >= threshold]
        return max(heard, key=lambda one: one[0])[1] if heard else None


@dataclass(frozen=True, eq=False)
class Explanation:
    """An inference with its maps, and what was thought of the rotations, bin i standing for i * 360 / k degrees.

    yaws: (k,) float32, probability of each gripper yaw at the pick; None for a network without a rotator.
    rotations: (k,) float32, probability of each rotation from pick to place, over all places.
    """

    inference: Inference
    yaws: NDArray[np.float32] | None
    rotations: NDArray[np.float32]
