"""Free places on the table by seeded rejection sampling."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from cliport_perception import PlanarPose, WorkspaceSpec
from sim_bridge.errors import LayoutError
from sim_bridge.objects import Kind

# least distances between centres [m], wide enough for an opened hand beside a block
CLEARANCE: dict[frozenset[Kind], float] = {
    frozenset({Kind.BOWL}): 0.134,
    frozenset({Kind.BLOCK, Kind.BOWL}): 0.115,
    frozenset({Kind.BLOCK}): 0.09,
}
MARGIN: dict[Kind, float] = {Kind.BLOCK: 0.05, Kind.BOWL: 0.07}  # from centre to the workspace's edge [m]

_LAYOUTS = 400
_DRAWS = 60


def sample_layout(kinds: Sequence[Kind], workspace: WorkspaceSpec, rng: np.random.Generator) -> list[PlanarPose]:
    """A place for each thing, in the same order, with any yaw.

    A thing that finds no room in a bounded number of draws starts the whole layout anew, a bounded number of
    times. Raises:
        LayoutError: when no layout was found.
    """
    for _ in range(_LAYOUTS):
        places: list[PlanarPose] = []
        for kind in kinds:
            place = _free_place(kind, kinds, places, workspace, rng)
            if place is None:
                break
            places.append(place)
        else:
            return places
    raise LayoutError(
        f"no room for {len(kinds)} objects on {workspace.x_max - workspace.x_min:.2f} m x "
        f"{workspace.y_max - workspace.y_min:.2f} m after {_LAYOUTS} layouts; use a larger workspace"
    )


def _free_place(
    kind: Kind,
    kinds: Sequence[Kind],
    places: Sequence[PlanarPose],
    workspace: WorkspaceSpec,
    rng: np.random.Generator,
) -> PlanarPose | None:
    margin = MARGIN[kind]
    for _ in range(_DRAWS):
        x = float(rng.uniform(workspace.x_min + margin, workspace.x_max - margin))
        y = float(rng.uniform(workspace.y_min + margin, workspace.y_max - margin))
        yaw = float(rng.uniform(-math.pi, math.pi))
        others = zip(kinds, places, strict=False)
        if all(math.hypot(x - p.x, y - p.y) >= CLEARANCE[frozenset({kind, k})] for k, p in others):
            return PlanarPose(x, y, yaw)
    return None
