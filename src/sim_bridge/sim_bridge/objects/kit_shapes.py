"""The twenty kitting shapes: prisms with the extents of the original's outlines.

See docs/benchmark.md, "Kitting shapes".
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from cliport_core import Pose
from sim_bridge.geometry.mesh import TriangleMesh
from sim_bridge.objects import kit_outlines as plain
from sim_bridge.objects import letter_outlines as letters
from sim_bridge.objects.collision import Collision, HullPart
from sim_bridge.objects.convex_pieces import convex_pieces
from sim_bridge.objects.outline import Outline
from sim_bridge.objects.outline_pinches import outline_pinches
from sim_bridge.objects.shape import Shape

THICKNESS = 0.02  # [m]
MASS = 0.1  # [kg]

_MARGIN = 0.0009  # by which a hull is drawn in, nearly the padding that PyBullet adds (collision.HULL_PADDING) [m]


@dataclass(frozen=True)
class KitShape:
    """Row of the table in docs/benchmark.md, "Kitting shapes".

    period: what the metric takes for the same, when the shape is turned by it [rad]; 0 when every turn is.
    symmetry: what truly maps the outline on itself; the same, but for the triangle, which is not equilateral.
    """

    name: str
    outline: Callable[[], Outline]
    period: float
    symmetry: float


def _row(name: str, outline: Callable[[], Outline], period: float, symmetry: float | None = None) -> KitShape:
    return KitShape(name, outline, period, period if symmetry is None else symmetry)


KIT_SHAPES: tuple[KitShape, ...] = (
    _row("letter R shape", letters.letter_r, math.tau),
    _row("letter A shape", letters.letter_a, math.tau),
    _row("triangle", plain.triangle, math.tau / 3, math.tau),
    _row("square", lambda: plain.rectangle(60, 60), math.tau / 4),
    _row("plus", plain.plus, math.tau / 4),
    _row("letter T shape", letters.letter_t, math.tau),
    _row("diamond", plain.diamond, math.tau / 2),
    _row("pentagon", plain.pentagon, math.tau / 5),
    _row("rectangle", lambda: plain.rectangle(75, 45), math.tau / 2),
    _row("flower", plain.flower, math.tau / 4),
    _row("star", plain.star, math.tau / 5),
    _row("circle", plain.circle, 0.0),
    _row("letter G shape", letters.letter_g, math.tau),
    _row("letter V shape", letters.letter_v, math.tau),
    _row("letter E shape", letters.letter_e, math.tau),
    _row("letter L shape", letters.letter_l, math.tau),
    _row("ring", plain.ring, 0.0),
    _row("hexagon", plain.hexagon, math.tau / 6),
    _row("heart", plain.heart, math.tau),
    _row("letter M shape", letters.letter_m, math.tau),
)
SEEN_SHAPES = tuple(range(14))
UNSEEN_SHAPES = tuple(range(14, 20))


@lru_cache(maxsize=len(KIT_SHAPES))
def kit_shape(index: int) -> Shape:
    """Return shape `index` of the table; its frame is in the middle of its bounding box and of its thickness."""
    row = KIT_SHAPES[index]
    outline = row.outline()
    mesh = TriangleMesh.extruded(outline.corners, THICKNESS, outline.holes)
    core = outline.inset(_MARGIN)
    heights = (-THICKNESS / 2 + _MARGIN, THICKNESS / 2 - _MARGIN)
    pieces = convex_pieces(core.corners, core.holes)
    hulls = [np.vstack([np.column_stack([p, np.full(len(p), z)]) for z in heights]) for p in pieces]
    return Shape(
        row.name,
        mesh.transformed(Pose(np.eye(3), np.array([0.0, 0.0, -THICKNESS / 2]))),
        Collision([HullPart(hull) for hull in hulls]),
        MASS,
        symmetry=row.symmetry,
        pinches=outline_pinches(outline),
    )
