"""The table area that is observed and acted on, and its grid of pixels."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import yaml

from cliport_core.errors import PixelOutsideError, WorkspaceError

_WHOLE = 1e-6  # how far an extent may be from a whole number of pixels [pixels]


@dataclass(frozen=True)
class WorkspaceSpec:
    """Bounds [m, base frame], pixel size [m] and number of discrete rotations.

    Rows run along +y, columns along +x: the default is 320 x 160 pixels of 2.5 mm.

    Raises:
        WorkspaceError: when the bounds are empty or not a whole number of pixels.
    """

    x_min: float = 0.25
    x_max: float = 0.65
    y_min: float = -0.4
    y_max: float = 0.4
    z_min: float = -0.02
    z_max: float = 0.28
    pixel_size: float = 0.0025
    n_rotations: int = 36

    def __post_init__(self) -> None:
        values = [getattr(self, f.name) for f in fields(self)]
        if not all(isinstance(v, (int, float)) and math.isfinite(v) for v in values):
            raise WorkspaceError(f"workspace values must be finite numbers, got {values}")
        if self.pixel_size <= 0.0:
            raise WorkspaceError(f"pixel_size must be positive, got {self.pixel_size}")
        if self.n_rotations < 1 or int(self.n_rotations) != self.n_rotations:
            raise WorkspaceError(f"n_rotations must be a positive whole number, got {self.n_rotations}")
        for axis in "xyz":
            low, high = getattr(self, f"{axis}_min"), getattr(self, f"{axis}_max")
            if high <= low:
                raise WorkspaceError(f"{axis}_max ({high}) must be greater than {axis}_min ({low})")
            pixels = (high - low) / self.pixel_size
            if axis != "z" and (pixels < 0.5 or abs(pixels - round(pixels)) > _WHOLE * max(1.0, pixels)):
                raise WorkspaceError(
                    f"{axis}_max - {axis}_min = {high - low:.6g} m is not a whole number of "
                    f"{self.pixel_size} m pixels; change the bounds or pixel_size"
                )

    @property
    def rows(self) -> int:
        """Number of pixels along y."""
        return round((self.y_max - self.y_min) / self.pixel_size)

    @property
    def cols(self) -> int:
        """Number of pixels along x."""
        return round((self.x_max - self.x_min) / self.pixel_size)

    @property
    def shape(self) -> tuple[int, int]:
        """Shape of the grid, (rows, cols)."""
        return self.rows, self.cols

    def pixel_to_xy(self, row: float, col: float) -> tuple[float, float]:
        """Return the centre (x, y) of a pixel [m, base frame]."""
        x = self.x_min + (float(col) + 0.5) * self.pixel_size
        y = self.y_min + (float(row) + 0.5) * self.pixel_size
        return x, y

    def xy_to_pixel(self, x: float, y: float) -> tuple[int, int]:
        """Return the pixel (row, col) that holds a position [m, base frame].

        Raises:
            PixelOutsideError: when the position is outside the workspace.
        """
        if not self.contains_xy(x, y):
            bounds = f"x {self.x_min:g}..{self.x_max:g}, y {self.y_min:g}..{self.y_max:g} m"
            raise PixelOutsideError(x, y, bounds)
        row, col = self.to_pixels((x, y))
        return int(row), int(col)

    def to_pixels(self, points: npt.ArrayLike) -> npt.NDArray[np.intp]:
        """Return the pixels (row, col) that hold points (..., 2) or (..., 3) [m, base frame], as (..., 2).

        Points outside the workspace get pixels outside the grid: ask `contains` first.
        """
        xy = np.asarray(points, dtype=np.float64)
        rows = self._indices(xy[..., 1], self.y_min, self.y_max, self.rows)
        cols = self._indices(xy[..., 0], self.x_min, self.x_max, self.cols)
        return np.stack([rows, cols], axis=-1).astype(np.intp)

    def _indices(self, values: npt.NDArray[np.float64], low: float, high: float, count: int) -> npt.NDArray[np.float64]:
        """Return the indices of pixels along one axis, `count` of them from `low` to `high` [m].

        Rounding in the division moves no value over the upper bound, in neither direction.
        """
        found = np.floor((values - low) / self.pixel_size)
        return np.where(values < high, np.minimum(found, count - 1), np.maximum(found, count))

    def contains(self, points: npt.ArrayLike, border: float = 0.0) -> npt.NDArray[np.bool_]:
        """Return a mask of the points (..., 2) or (..., 3) [m, base frame] inside the bounds (upper ones excluded).

        border: how far inside they must be [m]; negative: how far outside they may be.
        """
        xy = np.asarray(points, dtype=np.float64)
        x, y = xy[..., 0], xy[..., 1]
        inside_x = (x >= self.x_min + border) & (x < self.x_max - border)
        return np.asarray(inside_x & (y >= self.y_min + border) & (y < self.y_max - border), dtype=np.bool_)

    def contains_xy(self, x: float, y: float) -> bool:
        """Return True if one position [m, base frame] is inside the bounds, the upper ones excluded."""
        return bool(self.contains((x, y)))

    def yaw_of_bin(self, index: int) -> float:
        """Return the angle of a rotation bin [rad], 0 <= yaw < 2 pi."""
        return (int(index) % self.n_rotations) * 2.0 * math.pi / self.n_rotations

    def bin_of_yaw(self, yaw: float) -> int:
        """Return the rotation bin nearest to an angle [rad, any turn]."""
        return round(yaw * self.n_rotations / (2.0 * math.pi)) % self.n_rotations

    def to_dict(self) -> dict[str, float | int]:
        """Return plain values, ready for YAML or JSON."""
        return asdict(self)

    @classmethod
    def from_dict(cls, values: dict[str, Any]) -> WorkspaceSpec:
        """Invert `to_dict`; absent keys take the defaults.

        Raises:
            WorkspaceError: on unknown keys or values that make no grid.
        """
        known = [f.name for f in fields(cls)]
        unknown = sorted(set(values) - set(known))
        if unknown:
            raise WorkspaceError(f"unknown workspace keys {unknown}; valid are {', '.join(known)}")
        try:
            numbers = {k: int(v) if k == "n_rotations" else float(v) for k, v in values.items()}
        except (TypeError, ValueError) as error:
            raise WorkspaceError(f"workspace values must be numbers: {error}") from None
        return cls(**numbers)  # type: ignore[arg-type]

    @classmethod
    def load(cls, path: str | Path) -> WorkspaceSpec:
        """Read a YAML file with a `workspace:` mapping.

        Raises:
            WorkspaceError: when the file is missing or describes no workspace.
        """
        try:
            content = yaml.safe_load(Path(path).read_text(encoding="utf-8"))
        except OSError as error:
            raise WorkspaceError(f"cannot read workspace file {path}: {error.strerror}") from None
        except (yaml.YAMLError, UnicodeDecodeError) as error:
            summary = str(error).splitlines()[0]
            raise WorkspaceError(f"workspace file {path} is not YAML: {summary}") from None
        if not isinstance(content, dict) or not isinstance(content.get("workspace"), dict):
            raise WorkspaceError(f"workspace file {path} must hold a mapping named 'workspace'")
        return cls.from_dict(content["workspace"])
