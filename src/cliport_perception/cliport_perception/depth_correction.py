"""The correction of a depth camera's scale and offset: true depth = scale x measured depth + offset."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from cliport_perception.errors import CalibrationError

MAX_SCALE_OFF = 0.1  # a scale farther from 1 is a wrong unit or a wrong calibration, not a sensor's error
MAX_OFFSET = 0.1  # [m]


@dataclass(frozen=True)
class DepthCorrection:
    """scale and offset [m] of a depth camera; the default changes nothing.

    Raises:
        CalibrationError: when they are not finite, or larger than any sensor's error.
    """

    scale: float = 1.0
    offset: float = 0.0

    def __post_init__(self) -> None:
        if not abs(self.scale - 1.0) <= MAX_SCALE_OFF:
            low, high = 1.0 - MAX_SCALE_OFF, 1.0 + MAX_SCALE_OFF
            raise CalibrationError(f"a depth scale must be from {low:g} to {high:g}, got {self.scale:g}")
        if not abs(self.offset) <= MAX_OFFSET:
            raise CalibrationError(f"a depth offset must be within {MAX_OFFSET:g} m, got {self.offset:g}")

    @property
    def is_identity(self) -> bool:
        """True if depth stays as it is."""
        return self.scale == 1.0 and self.offset == 0.0

    def apply(self, depth_m: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
        """Return the corrected depth (H, W) [m], NaN where it is unknown; the same array when nothing changes."""
        if self.is_identity:
            return depth_m
        corrected = depth_m * np.float32(self.scale)
        corrected += np.float32(self.offset)
        corrected[corrected <= 0.0] = np.nan
        return corrected

    def after(self, earlier: DepthCorrection) -> DepthCorrection:
        """Return one correction that does what `earlier` and then this one do. Raises CalibrationError."""
        return DepthCorrection(self.scale * earlier.scale, self.scale * earlier.offset + self.offset)

    def is_close(self, other: DepthCorrection, tolerance: float = 1e-6) -> bool:
        """Return True if both differ by no more than `tolerance`."""
        return abs(self.scale - other.scale) <= tolerance and abs(self.offset - other.offset) <= tolerance

    def to_dict(self) -> dict[str, float]:
        """Return plain values, ready for YAML or JSON."""
        return {"scale": self.scale, "offset": self.offset}

    @classmethod
    def from_dict(cls, values: Any) -> DepthCorrection:
        """Return the correction of values as `to_dict` gives them. Raises CalibrationError."""
        if not isinstance(values, dict) or set(values) != {"scale", "offset"}:
            raise CalibrationError(f"depth must hold scale and offset [m], got {values!r}")
        for key, value in values.items():
            if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
                raise CalibrationError(f"depth.{key} must be a finite number, got {value!r}")
        return cls(float(values["scale"]), float(values["offset"]))


AS_MEASURED = DepthCorrection()
