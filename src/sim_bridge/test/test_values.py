"""Definitions that no function runs: dataclasses, and the everyday objects as they are put together.

everyday_objects.json holds a row an object, in mm and RGB. After a wanted change of an object write it anew:

    python src/sim_bridge/test/test_values.py
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from sim_bridge.clutter import ClutterConfig
from sim_bridge.everyday import google_names
from sim_bridge.everyday.catalogue import SEEN, UNSEEN
from sim_bridge.everyday.primitives import Parts
from sim_bridge.geometry.mesh import TriangleMesh

OBJECTS = {**SEEN, **UNSEEN}
TABLE = Path(__file__).with_name("everyday_objects.json")


def measured(parts: Parts) -> list[float]:
    """Return what tells an object from one that differs a little.

    That is the lowest and highest corner (3,), the middle of the surface (3,) and its spread (3,) [mm], its area
    [cm^2], its mean colour (3,), the spread of its colours, the volume of its solid parts [cm^3] and their common
    middle (3,) [mm].
    """
    mesh = TriangleMesh.joined([part.mesh() for part in parts])
    corners = mesh.vertices[mesh.triangles].astype(np.float64)
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2.0
    assert mesh.colors is not None
    color = np.average(mesh.colors.astype(np.float64), axis=0, weights=areas)
    spread = np.average(np.abs(mesh.colors - color).sum(axis=1), weights=areas)
    middles = corners.mean(axis=1)
    surface = np.average(middles, axis=0, weights=areas)
    deviation = np.sqrt(np.average((middles - surface) ** 2, axis=0, weights=areas))
    hulls = [hull for part in parts for hull in part.hulls()]
    volumes = [ConvexHull(hull).volume for hull in hulls]
    middle = np.average([hull.mean(axis=0) for hull in hulls], axis=0, weights=volumes)
    values = [
        *(1000.0 * corners.min(axis=(0, 1))),
        *(1000.0 * corners.max(axis=(0, 1))),
        *(1000.0 * surface),
        *(1000.0 * deviation),
        *(1e4 * areas.sum(), *color, spread, 1e6 * sum(volumes)),
        *(1000.0 * middle),
    ]
    return [round(float(value), 3) for value in values]


def test_everyday_objects_are_as_they_were_made() -> None:
    kept = json.loads(TABLE.read_text())
    assert list(kept) == list(OBJECTS)
    found = {name: measured(parts) for name, parts in OBJECTS.items()}
    assert {name: row for name, row in found.items() if row != pytest.approx(kept[name], rel=1e-5, abs=2e-3)} == {}


def test_the_colors_of_google_objects_are_those_that_were_chosen() -> None:
    """Their sums notice any that differs; scenes without textures are compared over versions."""
    sums = [np.sum(list(names.values()), axis=0).tolist() for names in (google_names.SEEN, google_names.UNSEEN)]
    assert sums == [[5450, 4282, 3620], [2838, 2680, 2344]]


def test_two_to_five_things_are_strewn() -> None:
    assert ClutterConfig() == ClutterConfig(2, 5, 0.08)


def test_dataclasses_are_values() -> None:
    from value_types import complaints  # tests/ is on the path of tests only

    assert complaints("sim_bridge", mutable={"_Listener"}) == []


if __name__ == "__main__":
    lines = [f'  "{name}": {json.dumps(measured(parts))}' for name, parts in OBJECTS.items()]
    TABLE.write_text("{\n" + ",\n".join(lines) + "\n}\n")
