"""Errors of cliport_perception: one root, values carried, the remedy named."""

from __future__ import annotations

from cliport_core.errors import CoreError


class PerceptionError(CoreError):
    """Root of what this package raises on purpose."""


class CameraModelError(PerceptionError):
    """Intrinsics or a distortion model that cannot be used."""


class UnfitFrameError(PerceptionError):
    """A frame that must not be acted on: too old, or hardly anything of the workspace seen."""


class CalibrationError(PerceptionError):
    """A calibration that cannot be made, read or written: what is wrong and what to do about it."""
