"""Light and table colour of the rendered scene, and their random variation for training data."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from sim_bridge.errors import SimulationError
from sim_bridge.rendering.table_texture import Pattern, TableTexture

_LOWEST_LIGHT = math.radians(5.0)


@dataclass(frozen=True)
class Appearance:
    """Light on the scene and look of the table.

    light_azimuth, light_elevation: where the light comes from [rad], azimuth about z from x, elevation above
    the table. diffuse, ambient: shares of a surface's colour; a level surface shows their weighted sum, so
    the defaults show the palette's own colours. table_rgb, floor_rgb, robot_rgb: 0..255. table_texture: what changes
    the table's colour from place to place; None: it is plain.

    Raises:
        SimulationError: when the light is not above the table.
    """

    light_azimuth: float = math.radians(40.0)
    light_elevation: float = math.radians(62.0)
    diffuse: float = 0.5
    ambient: float = 0.56
    table_rgb: tuple[float, float, float] = (74.0, 76.0, 80.0)
    floor_rgb: tuple[float, float, float] = (46.0, 44.0, 42.0)
    robot_rgb: tuple[float, float, float] = (222.0, 224.0, 226.0)
    table_texture: TableTexture | None = None

    def __post_init__(self) -> None:
        if not _LOWEST_LIGHT <= self.light_elevation <= math.pi / 2:
            degrees = math.degrees(self.light_elevation)
            raise SimulationError(f"a light at an elevation of {degrees:.1f} degrees: give one from 5 to 90")

    @property
    def to_light(self) -> tuple[float, float, float]:
        """Unit vector from the scene to the light, base frame."""
        level = math.cos(self.light_elevation)
        return (
            level * math.cos(self.light_azimuth),
            level * math.sin(self.light_azimuth),
            math.sin(self.light_elevation),
        )

    def table_colors(self, points: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
        """Return the table's colour 0..255, (K, 3) or (3,), at points (K, 3) [m, base frame]."""
        if self.table_texture is None:
            return np.array(self.table_rgb, dtype=np.float32)
        return self.table_texture.colors(points, self.table_rgb)


@dataclass(frozen=True)
class AppearanceRanges:
    """Ranges from which looks are drawn uniformly: each pair is the lowest and the highest value.

    light_elevation [rad]; the light's azimuth is any. brightness: what a lit level surface shows of its colour;
    diffuse_share: of that, what the directed light gives. exposure: factor on all that the camera shows. table_grey:
    mean of the table's channels, 0..255; table_tint: how far each may lie from it; texture_contrast: how far the
    texture's other colour lies from the table's, per channel; texture_period [m]. The defaults keep the palette's
    colours apart.
    """

    light_elevation: tuple[float, float] = (math.radians(45.0), math.radians(82.0))
    brightness: tuple[float, float] = (0.88, 1.1)
    diffuse_share: tuple[float, float] = (0.3, 0.6)
    exposure: tuple[float, float] = (0.8, 1.2)
    table_grey: tuple[float, float] = (45.0, 105.0)
    table_tint: float = 8.0
    texture_contrast: tuple[float, float] = (10.0, 40.0)
    texture_period: tuple[float, float] = (0.02, 0.12)


def random_appearance(rng: np.random.Generator, ranges: AppearanceRanges | None = None) -> Appearance:
    """Draw a light from anywhere above and a greyish table."""
    ranges = ranges or AppearanceRanges()
    elevation = float(rng.uniform(*ranges.light_elevation))
    level = float(rng.uniform(*ranges.brightness))
    share = float(rng.uniform(*ranges.diffuse_share))
    grey = float(rng.uniform(*ranges.table_grey))
    tint = rng.uniform(-ranges.table_tint, ranges.table_tint, size=3)
    r, g, b = (float(v) for v in np.clip(grey + tint, 0.0, 255.0))
    return Appearance(
        light_azimuth=float(rng.uniform(-math.pi, math.pi)),
        light_elevation=elevation,
        diffuse=level * share / math.sin(elevation),
        ambient=level * (1.0 - share),
        table_rgb=(r, g, b),
    )


def random_light(look: Appearance, rng: np.random.Generator, ranges: AppearanceRanges | None = None) -> Appearance:
    """Return a look under a light from anywhere above, and under another exposure."""
    ranges = ranges or AppearanceRanges()
    drawn = random_appearance(rng, ranges)
    exposure = float(rng.uniform(*ranges.exposure))
    return replace(
        look,
        light_azimuth=drawn.light_azimuth,
        light_elevation=drawn.light_elevation,
        diffuse=exposure * drawn.diffuse,
        ambient=exposure * drawn.ambient,
    )


def random_table(look: Appearance, rng: np.random.Generator, ranges: AppearanceRanges | None = None) -> Appearance:
    """Return a look with another colour of the table, and a pattern on it."""
    ranges = ranges or AppearanceRanges()
    own = random_appearance(rng, ranges).table_rgb
    contrast = float(rng.uniform(*ranges.texture_contrast)) * rng.uniform(0.6, 1.0, size=3)
    r, g, b = (float(v) for v in np.clip(np.array(own) + rng.choice((-1.0, 1.0)) * contrast, 0.0, 255.0))
    texture = TableTexture(
        list(Pattern)[int(rng.integers(len(Pattern)))],
        (r, g, b),
        float(rng.uniform(*ranges.texture_period)),
        float(rng.uniform(-math.pi, math.pi)),
        int(rng.integers(1 << 31)),
    )
    return replace(look, table_rgb=own, table_texture=texture)
