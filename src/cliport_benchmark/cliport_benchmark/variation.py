"""Variations from scene to scene, set by `--randomize`, so that robustness can be measured and trained for."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, field
from enum import Enum
from typing import Any

import numpy as np

from cliport_benchmark.errors import OptionError
from cliport_core import Pose
from sim_bridge.clutter import ClutterConfig, add_clutter
from sim_bridge.rendering.appearance import Appearance, AppearanceRanges, random_light, random_table
from sim_bridge.rendering.mounting import mounting_error
from sim_bridge.scene import Stream, scene_rng
from sim_bridge.tasks import Task
from sim_bridge.world import SimWorld


class Aspect(Enum):
    """One thing that may vary; the order is part of every scene's seed."""

    LIGHT = "light"  # where it comes from, how much of it is directed, exposure
    TEXTURE = "texture"  # the table's colour and pattern
    CLUTTER = "clutter"  # things that no sentence names
    MOUNTING = "mounting"  # the camera stands elsewhere than calibration says


@dataclass(frozen=True)
class MountingErrors:
    """Standard deviations per axis of the camera's true pose about the calibrated one: shift [m] and turn [rad]."""

    shift: float = 0.0015
    turn: float = 0.0015


@dataclass(frozen=True)
class SceneLook:
    """Look of one scene: light and table, and where the camera truly is."""

    appearance: Appearance
    true_camera_in_base: Pose


@dataclass(frozen=True)
class Variation:
    """The aspects that vary, and how much. Each is seeded by the scene on its own: another one changes nothing in it.

    Raises:
        OptionError: on impossible mounting errors.
    """

    aspects: frozenset[Aspect] = frozenset()
    look: AppearanceRanges = field(default_factory=AppearanceRanges)
    clutter: ClutterConfig = field(default_factory=ClutterConfig)
    mounting: MountingErrors = field(default_factory=MountingErrors)

    def __post_init__(self) -> None:
        for value in (self.mounting.shift, self.mounting.turn):
            if not (math.isfinite(value) and value >= 0.0):
                raise OptionError(f"--mounting-error must be zero or more millimetres and degrees, got {self.mounting}")

    @classmethod
    def parse(cls, text: str | None, mounting_mm_deg: tuple[float, float] | None = None) -> Variation:
        """Parse aspects' names with commas between, `all`, or None for nothing.

        mounting_mm_deg: standard deviations of the camera's shift [mm] and turn [degrees] per axis.

        Raises:
            OptionError: on an unknown name, or errors of a mounting that does not vary.
        """
        names = [] if text is None else [part.strip() for part in text.split(",")]
        if names == ["all"]:
            names = [aspect.value for aspect in Aspect]
        valid = [aspect.value for aspect in Aspect]
        for name in names:
            if name not in valid:
                raise OptionError(f"--randomize {text}: unknown '{name}'; choose from {', '.join(valid)}, or all")
        aspects = frozenset(map(Aspect, names))
        if mounting_mm_deg is None:
            return cls(aspects)
        if Aspect.MOUNTING not in aspects:
            raise OptionError("--mounting-error needs --randomize mounting")
        shift, turn = mounting_mm_deg
        return cls(aspects, mounting=MountingErrors(shift / 1000.0, math.radians(turn)))

    def settings(self) -> dict[str, Any]:
        """Return what varies, by name, with the ranges that it is drawn from; empty when nothing does."""
        ranges = {
            Aspect.LIGHT: asdict(self.look),
            Aspect.TEXTURE: asdict(self.look),
            Aspect.CLUTTER: asdict(self.clutter),
            Aspect.MOUNTING: asdict(self.mounting),
        }
        light = ("light_elevation", "brightness", "diffuse_share", "exposure")
        ranges[Aspect.LIGHT] = {name: ranges[Aspect.LIGHT][name] for name in light}
        ranges[Aspect.TEXTURE] = {n: v for n, v in ranges[Aspect.TEXTURE].items() if n not in light}
        return {aspect.value: ranges[aspect] for aspect in Aspect if aspect in self.aspects}

    def scene_look(self, nominal: Appearance, camera_in_base: Pose, rng: np.random.Generator) -> SceneLook:
        """Draw how a scene is seen from children of rng, which is not drawn from itself."""
        if not self.aspects:
            return SceneLook(nominal, camera_in_base)
        light, texture, mounting = rng.spawn(3)
        appearance = nominal
        if Aspect.TEXTURE in self.aspects:
            appearance = random_table(appearance, texture, self.look)
        if Aspect.LIGHT in self.aspects:
            appearance = random_light(appearance, light, self.look)
        if Aspect.MOUNTING in self.aspects:
            camera_in_base = mounting_error(camera_in_base, mounting, self.mounting.shift, self.mounting.turn)
        return SceneLook(appearance, camera_in_base)

    def add_to(self, world: SimWorld, task: Task, seed: int) -> None:
        """Add what lies about to a scene that was set up.

        Raises:
            PhysicsError: when objects flew apart.
        """
        if Aspect.CLUTTER in self.aspects:
            add_clutter(world, task, scene_rng(task.name, task.split, seed, Stream.CLUTTER), self.clutter)
