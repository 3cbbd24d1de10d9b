"""Errors of demo_tool: one root, one line for a person each."""

from __future__ import annotations

from collections.abc import Iterable

from cliport_core.errors import CoreError
from cliport_episodes.errors import EpisodesError


class DemoToolError(Exception):
    """Root of everything that this package raises on purpose."""


class StationError(DemoToolError):
    """A command that the station refuses; the message is one line that says why, and what would do."""


class CommandError(StationError):
    """A command that does not exist, or with arguments that cannot be used."""


class UnknownCommandError(CommandError):
    """A command with a name that is not known."""

    def __init__(self, name: str, known: Iterable[str]) -> None:
        self.name, self.known = name, tuple(known)
        super().__init__(f"there is no command '{name[:40]}'; there are {', '.join(self.known)}")


class NotNowError(StationError):
    """A command that has no meaning, or must not be obeyed, in the station's present state."""


class BoxError(StationError):
    """A box without a target for pick or place: it has no depth, no object, or is outside the workspace."""


EXPECTED_ERRORS = (StationError, EpisodesError, CoreError, OSError)
"""What a command may end in, in words for a person; anything else is a defect."""
