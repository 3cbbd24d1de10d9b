"""Shapes of the tasks' things, a row each, in mm and grams.

shapes.json holds the rows. After a wanted change of a shape write it anew:

    python src/sim_bridge/test/test_shape_table.py
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from sim_bridge.objects import BoxPart, CylinderPart, Shape, block_shape, bowl_shape, container_shape, cuboid
from sim_bridge.objects.clutter_shapes import clutter_shapes
from sim_bridge.objects.corner import corner_shape
from sim_bridge.objects.hanoi import RING_DIAMETERS, hanoi_stand_shape, ring_shape
from sim_bridge.objects.kit import hole_shape, kit_slab
from sim_bridge.objects.kit_shapes import KIT_SHAPES, kit_shape
from sim_bridge.objects.l_block import l_block_shape, l_fixture_shape
from sim_bridge.objects.pallet import pallet_shape
from sim_bridge.objects.pile import pile_block_shape, zone_shape
from sim_bridge.objects.pyramid_stand import pyramid_stand_shape
from sim_bridge.objects.rope import bead_shape, square_shape

TABLE = Path(__file__).with_name("shapes.json")


def _anew(make: Callable[..., Shape], *arguments: float) -> Callable[[], Shape]:
    """Return a maker that does not take the shape that was made before."""
    return partial(getattr(make, "__wrapped__", make), *arguments)


MAKERS: dict[str, Callable[[], Shape]] = {
    "block": _anew(block_shape),
    "box of 3 x 6 x 8 cm": lambda: cuboid("box", (0.03, 0.06, 0.08), 0.2, 0.7),
    "box of 8 x 9 x 2 cm": lambda: cuboid("box", (0.08, 0.09, 0.02), 0.2),
    "bowl": _anew(bowl_shape),
    "container": _anew(container_shape, 0.2, 0.12),
    "corner": _anew(corner_shape, 0.1, 0.06),
    "stand of Hanoi": _anew(hanoi_stand_shape),
    **{f"ring of {1000 * d:.0f} mm": _anew(ring_shape, d) for d in RING_DIAMETERS},
    "kit": _anew(kit_slab),
    **{shape.name: _anew(kit_shape, i) for i, shape in enumerate(KIT_SHAPES)},
    "letter G shape hole": _anew(hole_shape, 12),
    "L block": _anew(l_block_shape),
    "L fixture": _anew(l_fixture_shape),
    "pallet": _anew(pallet_shape),
    "small block": _anew(pile_block_shape),
    "zone": _anew(zone_shape),
    "stand of the pyramid": _anew(pyramid_stand_shape),
    "bead": _anew(bead_shape),
    "rope's square": _anew(square_shape),
    **{f"clutter {i}": lambda i=i: clutter_shapes.__wrapped__()[i] for i in range(5)},  # type: ignore[misc]
}


def measured(shape: Shape) -> list[float]:
    """Return what tells a shape from one that differs a little.

    That is the lowest and highest corner (3,) [mm], the area of its surface [cm^2], the middle (3,) and spread (3,) of
    that [mm], its mean colour; number, volume [cm^3] and the corners' spread (3,) [mm] of its collision parts; mass
    [g], friction, rolling friction, symmetry [degrees]; number of pinches, and the first ones [mm, degrees].
    """
    corners = shape.mesh.vertices[shape.mesh.triangles].astype(np.float64)
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2.0
    middle = np.average(corners.mean(axis=1), axis=0, weights=areas)
    spread = np.sqrt(np.average(((corners - middle) ** 2).mean(axis=1), axis=0, weights=areas))
    colors = np.zeros((1, 3)) if shape.mesh.colors is None else shape.mesh.colors.astype(np.float64)
    parts = [] if shape.collision is None else list(shape.collision.parts)
    reach = np.array([np.abs(part.corners).mean(axis=0) for part in parts] or [np.zeros(3)]).mean(axis=0)
    values = [
        *(1000.0 * corners.min(axis=(0, 1))),
        *(1000.0 * corners.max(axis=(0, 1))),
        *(1e4 * areas.sum(), *(1000.0 * middle), *(1000.0 * spread), colors.mean()),
        *(len(parts), 1e6 * sum(map(_volume, parts)), *(1000.0 * reach)),
        *(1000.0 * shape.mass, shape.friction, 1e4 * shape.rolling_friction, math.degrees(shape.symmetry)),
        len(shape.pinches),
    ]
    for pinch in shape.pinches[:3]:
        values += [1000.0 * pinch.x, 1000.0 * pinch.y, math.degrees(pinch.yaw), 1000.0 * pinch.width]
    return [round(float(value), 3) for value in values]


def _volume(part: object) -> float:
    if isinstance(part, BoxPart):
        return math.prod(part.size)
    if isinstance(part, CylinderPart):
        return math.pi * part.radius**2 * part.height
    return float(ConvexHull(part.corners).volume)  # type: ignore[attr-defined]


@pytest.mark.parametrize("name", MAKERS)
def test_a_shape_is_as_it_was_made(name: str) -> None:
    assert measured(MAKERS[name]()) == pytest.approx(json.loads(TABLE.read_text())[name], rel=1e-5, abs=2e-3)


if __name__ == "__main__":
    lines = [f'  "{name}": {json.dumps(measured(make()))}' for name, make in MAKERS.items()]
    TABLE.write_text("{\n" + ",\n".join(lines) + "\n}\n")
