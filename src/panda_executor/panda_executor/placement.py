"""How low the hand goes at the place: the object just above what is there, the opened fingers beside it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from cliport_perception.pose import PlanarPose
from cliport_perception.workspace import WorkspaceSpec
from panda_executor.grasp import Grasp
from panda_executor.ground_cells import GroundCells, points_near
from panda_executor.hand_geometry import (
    FINGER_HALF_WIDTH,
    FINGER_THICKNESS,
    FINGERTIP_BELOW_TCP,
    MAX_OPENING,
)
from panda_executor.limits import FloatArray


@dataclass(frozen=True)
class PlacementConfig:
    """Lengths in m.

    drop: gap left under the object; release_margin: how much wider than the object the fingers open;
    finger_clearance: between the fingertips and what they would stand on; pixels: edge of the square seen.
    """

    drop: float = 0.003
    release_margin: float = 0.02
    finger_clearance: float = 0.004
    footprint_margin: float = 0.004
    pixels: int = 64


@dataclass(frozen=True)
class Placement:
    """Where the object is let go: tcp height and the fingers' opening there [m], yaw of the jaws [rad].

    support_z is what the object is expected to come to rest on, as far as it is seen [m].
    """

    x: float
    y: float
    tcp_z: float
    yaw: float
    opening: float
    support_z: float


def plan_placement(
    cloud: npt.NDArray[np.float32],
    place: PlanarPose,
    yaw: float,
    grasp: Grasp,
    workspace: WorkspaceSpec,
    table_z: float = 0.0,
    config: PlacementConfig | None = None,
) -> Placement:
    """The lowest release that touches nothing but what the object is to rest on.

    Args:
        cloud: (N, 3) [m, base frame], NaN allowed, without the points of the grasped object itself.
        place: where the object's centroid goes; yaw: of the jaws there [rad].

    What is seen under the object's footprint, turned as it will be, lifts it. What is seen where the fingers
    open (a bowl's rim) lifts the hand: the object then falls the rest of the way, a bowl's depth at most.
    """
    config = config or PlacementConfig()
    half = config.pixels / 2.0 * workspace.pixel_size
    near = cloud[points_near(cloud, place.x, place.y, half)]
    cells = GroundCells.around(near, workspace, place.x, place.y, config.pixels, (table_z - 0.03, workspace.z_max))
    turn = yaw - grasp.yaw
    c, s = math.cos(turn), math.sin(turn)
    footprint = grasp.footprint @ np.array([[c, s], [-s, c]])
    reach = config.footprint_margin + cells.cell / 2.0
    under = np.zeros(cells.seen.shape, dtype=bool)
    relative = np.stack([cells.x - place.x, cells.y - place.y], axis=-1)
    for offset in footprint:
        under |= np.all(np.abs(relative - offset) <= reach, axis=-1)
    support_z = max(_level(cells.top[under & cells.seen], 95.0), table_z)
    opening = min(grasp.width + config.release_margin, MAX_OPENING)
    along = np.abs(relative @ np.array([math.cos(yaw), math.sin(yaw)]))
    across = np.abs(relative @ np.array([-math.sin(yaw), math.cos(yaw)]))
    gap = config.finger_clearance
    fingers = (across < FINGER_HALF_WIDTH + gap) & (along > grasp.width / 2.0 - gap)
    fingers &= along < opening / 2.0 + FINGER_THICKNESS + gap
    around_z = max(_level(cells.top[fingers & cells.seen], 98.0), table_z)
    below = max(grasp.tcp_z - grasp.support_z, FINGERTIP_BELOW_TCP)
    tcp_z = max(
        support_z + below + config.drop,
        around_z + FINGERTIP_BELOW_TCP + config.finger_clearance,
    )
    return Placement(place.x, place.y, tcp_z, yaw, opening, support_z)


def _level(heights: FloatArray, percentile: float) -> float:
    return float(np.percentile(heights, percentile)) if heights.size else -math.inf
