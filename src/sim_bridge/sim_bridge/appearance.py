"""Light and table colour of the rendered scene, and their random variation for training data."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Appearance:
    """How the scene is lit and what the table looks like.

    light_azimuth, light_elevation: where the light comes from [rad], azimuth about z from x, elevation above
    the table. diffuse, ambient: shares of a surface's colour; a level surface shows their weighted sum, so
    the defaults show the palette's own colours. table_rgb: 0..255.
    """

    light_azimuth: float = math.radians(40.0)
    light_elevation: float = math.radians(62.0)
    diffuse: float = 0.5
    ambient: float = 0.56
    table_rgb: tuple[float, float, float] = (74.0, 76.0, 80.0)
    floor_rgb: tuple[float, float, float] = (46.0, 44.0, 42.0)
    robot_rgb: tuple[float, float, float] = (222.0, 224.0, 226.0)

    @property
    def to_light(self) -> tuple[float, float, float]:
        """Unit vector from the scene to the light, base frame."""
        level = math.cos(self.light_elevation)
        return (
            level * math.cos(self.light_azimuth),
            level * math.sin(self.light_azimuth),
            math.sin(self.light_elevation),
        )


def random_appearance(rng: np.random.Generator) -> Appearance:
    """A light from anywhere above and a greyish table, within what keeps the palette's colours apart."""
    elevation = math.radians(rng.uniform(45.0, 82.0))
    level = float(rng.uniform(0.88, 1.1))  # brightness of a lit level surface
    share = float(rng.uniform(0.3, 0.6))  # of it, what the directed light gives
    grey = float(rng.uniform(45.0, 105.0))
    r, g, b = (float(v) for v in np.clip(grey + rng.uniform(-8.0, 8.0, size=3), 0.0, 255.0))
    return Appearance(
        light_azimuth=float(rng.uniform(-math.pi, math.pi)),
        light_elevation=elevation,
        diffuse=level * share / math.sin(elevation),
        ambient=level * (1.0 - share),
        table_rgb=(r, g, b),
    )
