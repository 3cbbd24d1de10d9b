"""The result of a calibration: what was found, how well it fits, and whether that is good enough to act on."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum
from typing import NamedTuple

import numpy as np

from cliport_core.pose import FloatArray, Pose
from cliport_perception.errors import CalibrationError

SIGMAS = 3.0  # standard deviations that an uncertainty spans


class Misfit(NamedTuple):
    """Distances of the model from what was seen: corners [px], the board's middle [mm], its orientation [deg]."""

    px: float
    mm: float
    deg: float


class Use(Enum):
    """Fates of a sample."""

    FITTED = "fitted"
    HELD_OUT = "held out"
    OUTLIER = "outlier"


class SampleMisfit(NamedTuple):
    """One sample's misfit. Of the held-out ones it is to the solution that never saw them."""

    use: Use
    misfit: Misfit


@dataclass(frozen=True)
class Uncertainty:
    """Bounds of the camera's error: `SIGMAS` standard deviations of its position [mm] and of its orientation [deg]."""

    mm: float
    deg: float

    @classmethod
    def of_covariance(cls, covariance: FloatArray) -> Uncertainty:
        """Return the bounds that a covariance (6, 6) of position [m] and turn [rad] gives."""
        variances = np.diag(covariance).clip(min=0.0)
        shift, turn = np.sqrt(variances[:3].sum()), np.sqrt(variances[3:6].sum())
        return cls(SIGMAS * 1e3 * float(shift), SIGMAS * float(np.degrees(turn)))


@dataclass(frozen=True)
class Acceptance:
    """Thresholds of a calibration that may be used: of the held-out misfit and of the uncertainty."""

    px: float = 1.0
    mm: float = 5.0
    deg: float = 0.5

    def faults(self, misfit: Misfit, uncertainty: Uncertainty, name: str = "held-out misfit") -> list[str]:
        """Return what is too large, each in words; nothing when the calibration is accepted. name: the misfit's."""
        found = []
        for what, unit, limit, value in (
            (name, "px", self.px, misfit.px),
            (name, "mm", self.mm, misfit.mm),
            (name, "deg", self.deg, misfit.deg),
            ("uncertainty", "mm", self.mm, uncertainty.mm),
            ("uncertainty", "deg", self.deg, uncertainty.deg),
        ):
            if not value <= limit:
                found.append(f"{what} {value:.2f} {unit} (at most {limit:g})")
        return found

    def check(
        self,
        misfit: Misfit,
        uncertainty: Uncertainty,
        name: str = "held-out misfit",
        remedy: str = "take more samples, nearer, with more turns",
    ) -> None:
        """Refuse a calibration that is not good enough. name: the misfit's.

        Raises:
            CalibrationError: naming every threshold that is passed, and the remedy.
        """
        faults = self.faults(misfit, uncertainty, name)
        if faults:
            raise CalibrationError(f"the calibration is not good enough: {', '.join(faults)}; {remedy}")


@dataclass(frozen=True, eq=False)
class EyeOnBase:
    """A solved eye-on-base calibration.

    camera_in_base: pose of the optical frame; board_in_gripper: where the board turned out to be held. held_out: misfit
    of samples to a solution that did not see them, a root mean square [px] and medians; fitted: of the others.
    camera_in_base itself is fitted to both, without the outliers. scale: of the printed board over its nominal size,
    and the standard deviation of that.
    """

    camera_in_base: Pose
    board_in_gripper: Pose
    fitted: Misfit
    held_out: Misfit
    uncertainty: Uncertainty
    samples: tuple[SampleMisfit, ...]
    scale: float = 1.0
    scale_sigma: float = field(default=0.0)

    @property
    def outliers(self) -> list[int]:
        """Indices of the samples that were left out."""
        return [i for i, sample in enumerate(self.samples) if sample.use is Use.OUTLIER]
