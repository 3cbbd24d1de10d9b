"""Errors of cliport_perception: one root, values carried, the remedy named."""

from __future__ import annotations

from collections.abc import Iterable


class PerceptionError(Exception):
    """Root of everything that this package raises on purpose."""


class WorkspaceError(PerceptionError):
    """A workspace description that makes no grid, or a file that does not describe one."""


class PixelOutsideError(PerceptionError):
    """A position outside the workspace was asked for its pixel."""

    def __init__(self, x: float, y: float, bounds: str) -> None:
        super().__init__(f"({x:.3f}, {y:.3f}) m lies outside the workspace, which spans {bounds}")
        self.x = x
        self.y = y


class CameraModelError(PerceptionError):
    """Intrinsics or a distortion model that cannot be used."""


class ImageError(PerceptionError):
    """An image whose size or buffer does not fit what was announced."""


class EncodingError(ImageError):
    """An image encoding that is not supported."""

    def __init__(self, what: str, encoding: str, supported: Iterable[str]) -> None:
        self.encoding = encoding
        self.supported = tuple(supported)
        super().__init__(f"{what} image has encoding '{encoding}'; supported are {', '.join(self.supported)}")


class FrameError(PerceptionError):
    """No chain of transforms joins two frames."""

    def __init__(self, source: str, target: str, known: Iterable[str]) -> None:
        self.source = source
        self.target = target
        self.known = tuple(sorted(known))
        names = ", ".join(self.known) if self.known else "none"
        super().__init__(f"no transform from '{source}' to '{target}' on /tf or /tf_static (known frames: {names})")


class UnfitFrameError(PerceptionError):
    """A frame that must not be acted on: too old, or hardly anything of the workspace seen."""
