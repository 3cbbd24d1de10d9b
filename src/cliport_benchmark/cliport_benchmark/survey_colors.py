"""Colours of a survey in place of the benchmark's: scenes painted so, and sentences that use the survey's names.

They measure what a policy makes of colour words that no demonstration used.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from cliport_benchmark.errors import OptionError
from cliport_policy.data.color_names import BASIC_TERMS, lab, survey
from sim_bridge.colors import COLORS, Rgb
from sim_bridge.rendering.appearance import Appearance
from sim_bridge.scene import Stream, scene_rng
from sim_bridge.tasks import Task
from sim_bridge.world import SimWorld

KEPT = "brown"  # looks and is called as ever: so are boxes, stands and kits, which sentences name too
LEAST_DISTANCE = 30.0  # in CIELAB, between any two colours of a scene, from brown and from the table's
_CRUDE = ("shit", "poo", "puke", "vomit", "piss", "snot", "barf", "booger")  # left out
_TRIES = 1000


def names_of_survey() -> tuple[str, ...]:
    """Return the survey's names that may be said: no basic colour term alone, none that is crude."""
    left_out = (*BASIC_TERMS, *COLORS, "grey")
    return tuple(name for name in survey() if name not in left_out and not any(word in name for word in _CRUDE))


def draw_colors(task: Task, seed: int) -> dict[str, str]:
    """Return a name of the survey for each of the benchmark's colours but brown, for the scene of a seed.

    Any two of the colours are LEAST_DISTANCE apart in CIELAB at least, so that a person could tell them.

    Raises:
        OptionError: if no such colours are found.
    """
    rng = scene_rng(task.name, task.split, seed, Stream.PAINT)
    changed = [color for color in COLORS if color != KEPT]
    names, colors, usable = _usable()
    for _ in range(_TRIES):
        chosen: list[int] = []
        left = usable.copy()
        while left.any() and len(chosen) < len(changed):
            chosen.append(int(rng.choice(np.flatnonzero(left))))
            left &= np.linalg.norm(colors - colors[chosen[-1]], axis=1) >= LEAST_DISTANCE
        if len(chosen) == len(changed):
            return dict(zip(changed, (names[i].replace("/", " ") for i in chosen), strict=True))
    raise OptionError(f"the survey has no {len(changed)} colours that are {LEAST_DISTANCE} apart")


def paint(world: SimWorld, task: Task, seed: int) -> dict[str, str]:
    """Give a world the paints of a seed's scene, which is made afterwards; return the names as draw_colors does."""
    names = draw_colors(task, seed)
    world.paints = {color: paint_of(name) for color, name in names.items()}
    return names


def paint_of(name: str) -> Rgb:
    """Return the colour of a name of the survey, RGB 0..255, as draw_colors spells it."""
    r, g, b = (round(255 * part) for part in _by_spoken_name()[name])
    return r, g, b


@lru_cache(maxsize=1)
def _by_spoken_name() -> dict[str, tuple[float, float, float]]:
    return {name.replace("/", " "): color for name, color in survey().items()}


@lru_cache(maxsize=1)
def _usable() -> tuple[tuple[str, ...], np.ndarray, np.ndarray]:
    """Return names (N), their CIELAB colours (N, 3), and which of them stand out from the table and brown (N,)."""
    names = names_of_survey()
    colors = lab(255 * np.array([survey()[name] for name in names], np.float32))
    others = lab(np.array([Appearance().table_rgb, COLORS[KEPT]], np.float32))
    return names, colors, np.linalg.norm(colors[:, None] - others, axis=2).min(axis=1) >= LEAST_DISTANCE
