"""Errors of panda_model: one root, values carried, the remedy named."""

from __future__ import annotations

from cliport_core.errors import CoreError


class PresetError(CoreError):
    """An unknown preset, or a preset's file that does not describe an arm and a hand."""


class DescriptionError(PresetError):
    """The URDF that a preset names is not installed, or cannot be read."""
