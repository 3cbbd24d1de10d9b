"""Errors of cliport_core: one root, values carried, the remedy named."""

from __future__ import annotations

from collections.abc import Iterable


class CoreError(Exception):
    """Root of what this package raises on purpose; the errors of cliport_perception derive from it too."""


class WorkspaceError(CoreError):
    """A workspace description that makes no grid, or a file that does not describe one."""


class PixelOutsideError(CoreError):
    """A position outside the workspace was asked for its pixel."""

    def __init__(self, x: float, y: float, bounds: str) -> None:
        super().__init__(f"({x:.3f}, {y:.3f}) m lies outside the workspace, which spans {bounds}")
        self.x = x
        self.y = y


class GoalError(CoreError):
    """A PickPlace goal that says nothing that could be done: its frame, a pose or its primitive."""


class ImageError(CoreError):
    """An image whose size or buffer does not fit what was announced."""


class EncodingError(ImageError):
    """An image encoding that is not supported."""

    def __init__(self, what: str, encoding: str, supported: Iterable[str]) -> None:
        self.encoding = encoding
        self.supported = tuple(supported)
        super().__init__(f"{what} image has encoding '{encoding}'; supported are {', '.join(self.supported)}")


class InstructionError(CoreError):
    """An instruction that is too long or cannot be printed."""


class FrameError(CoreError):
    """No chain of transforms joins two frames."""

    def __init__(self, source: str, target: str, known: Iterable[str]) -> None:
        self.source = source
        self.target = target
        self.known = tuple(sorted(known))
        names = ", ".join(self.known) if self.known else "none"
        super().__init__(f"no transform from '{source}' to '{target}' on /tf or /tf_static (known frames: {names})")
