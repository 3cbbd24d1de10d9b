"""Errors of cliport_episodes: one root, values carried, the remedy named."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path


class EpisodesError(Exception):
    """Root of everything that this package raises on purpose."""


class BadNameError(EpisodesError):
    """A name of a data set or an episode that cannot be used as a file name."""

    def __init__(self, what: str, name: str) -> None:
        self.name = name
        super().__init__(
            f"{what} name {name[:80]!r} cannot be used: 1 to 100 of A-Z a-z 0-9 . _ - and no dot at the beginning"
        )


class InstructionError(EpisodesError):
    """An instruction that cannot be stored."""


class RecordError(EpisodesError):
    """A step's record with values that no step can have."""


class SetupError(EpisodesError):
    """Values that describe no camera or workspace."""


class SetupDiffersError(EpisodesError):
    """A recording made with another camera, calibration or workspace than the data set's."""

    def __init__(self, data_set: str, differences: Sequence[str]) -> None:
        self.differences = tuple(differences)
        super().__init__(
            f"data set '{data_set}' was recorded with another setup: {'; '.join(differences)}. Begin a new data set"
        )


class DataSetError(EpisodesError):
    """A folder that is not the data set that was asked for."""


class EpisodeError(EpisodesError):
    """An episode that is not there, or whose state does not allow what was asked."""


class EpisodeBusyError(EpisodeError):
    """An episode that another program, or another part of this one, is writing."""

    def __init__(self, path: Path) -> None:
        self.path = path
        super().__init__(f"episode '{path.name}' is being recorded or changed elsewhere: end that first")


class BagError(EpisodesError):
    """A bag, or a message in it, that cannot be read."""


class NoMetadataError(BagError):
    """A bag without its metadata.yaml."""


class LaterFormatError(BagError):
    """Edits that a later version of this software wrote."""


class ObservationError(BagError):
    """A step that lacks a message of its observation, or has an unusable one."""


class DiskError(EpisodesError):
    """A write that the disk refused; what was complete before stays so."""

    def __init__(self, path: Path, reason: str, remedy: str) -> None:
        self.path = path
        super().__init__(f"cannot write '{path}': {reason}. What was saved before is whole. {remedy}")


class DiskFullError(DiskError):
    """A write for which the disk has no space."""
