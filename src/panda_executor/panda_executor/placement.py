"""How low the hand goes at the place: the object just above what is there, the opened fingers beside it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy import ndimage

from cliport_perception.pose import PlanarPose
from cliport_perception.workspace import WorkspaceSpec
from panda_executor.grasp import Grasp
from panda_executor.ground_cells import BoolArray, GroundCells, points_near
from panda_executor.hand_geometry import (
    FINGER_HALF_WIDTH,
    FINGER_THICKNESS,
    FINGERTIP_BELOW_TCP,
    HAND_HALF_LENGTH,
    HAND_HALF_WIDTH,
    MAX_OPENING,
    MOUNT_ABOVE_TCP,
    MOUNT_THICKNESS,
    PALM_ABOVE_TCP,
)
from panda_executor.limits import FloatArray


@dataclass(frozen=True)
class PlacementConfig:
    """Lengths in m.

    drop: gap left under the object; margins: how much wider than the object the fingers may open, the best
    first; worth: a worse one is taken when the hand then goes lower by this much for it; finger_clearance:
    between the fingertips and what they would stand on; beside: between the fingers and what is higher;
    pixels: edge of the square seen.
    """

    drop: float = 0.003
    margins: tuple[float, ...] = (0.02, 0.016, 0.012)
    worth: float = 0.002
    finger_clearance: float = 0.004
    beside: float = 0.004
    pixels: int = 96


@dataclass(frozen=True)
class Placement:
    """Where the object is let go: tcp height and the fingers' opening there [m], yaw of the jaws [rad].

    support_z is what the object is expected to come to rest on, as far as it is seen [m]; fall: how much
    higher than wished the fingers' surroundings keep it [m].
    """

    x: float
    y: float
    tcp_z: float
    yaw: float
    opening: float
    support_z: float
    fall: float = 0.0


def plan_placement(
    cloud: npt.NDArray[np.float32],
    place: PlanarPose,
    yaw: float,
    grasp: Grasp,
    workspace: WorkspaceSpec,
    table_z: float = 0.0,
    config: PlacementConfig | None = None,
) -> Placement:
    """The lowest release at which the fingers open without touching what stands there.

    Args:
        cloud: (N, 3) [m, base frame], NaN allowed, without the points of the grasped object itself.
        place: where the object's centroid goes; yaw: of the jaws there [rad].

    What is seen under the object's footprint, turned as it will be, lifts it. What is seen where the fingers
    open (a bowl's rim, a box's wall) lifts the hand: the object then falls the rest of the way. Fingers that open
    less may go lower between things.
    """
    config = config or PlacementConfig()
    half = config.pixels / 2.0 * workspace.pixel_size
    near = cloud[points_near(cloud, place.x, place.y, half)]
    cells = GroundCells.around(near, workspace, place.x, place.y, config.pixels, (table_z - 0.03, workspace.z_max))
    under = cells.top[_under(cells, place, grasp, yaw - grasp.yaw)]
    support_z = max(float(np.percentile(under, 95.0)) if under.size else table_z, table_z)
    below = max(grasp.tcp_z - grasp.support_z, FINGERTIP_BELOW_TCP)
    least = support_z + below + config.drop
    chosen: tuple[float, float] | None = None
    for margin in config.margins:
        opening = min(grasp.width + margin, MAX_OPENING)
        tcp_z = max(least, _above_surroundings(cells, place, yaw, grasp.width, opening, config))
        if chosen is None or tcp_z < chosen[0] - config.worth:
            chosen = tcp_z, opening
    assert chosen is not None  # there are margins
    return Placement(place.x, place.y, chosen[0], yaw, chosen[1], support_z, chosen[0] - least)


def _under(cells: GroundCells, place: PlanarPose, grasp: Grasp, turn: float) -> BoolArray:
    """The cells seen under the object, turned by `turn` [rad] from where it was grasped."""
    c, s = math.cos(turn), math.sin(turn)
    footprint = grasp.footprint @ np.array([[c, s], [-s, c]])
    n = len(cells.seen)
    column, row = np.floor(footprint / cells.cell + n / 2.0).astype(np.int64).T
    inside = (row >= 0) & (row < n) & (column >= 0) & (column < n)
    under = np.zeros((n, n), dtype=bool)
    under[row[inside], column[inside]] = True
    # turned cells leave gaps between them
    return ndimage.binary_closing(under, structure=np.ones((3, 3))) & cells.seen


def _above_surroundings(
    cells: GroundCells, place: PlanarPose, yaw: float, width: float, opening: float, config: PlacementConfig
) -> float:
    """The lowest tcp [m] at which the hand is above everything seen while its fingers open from `width` [m]."""
    dx, dy = cells.x - place.x, cells.y - place.y
    along = np.abs(dx * math.cos(yaw) + dy * math.sin(yaw))
    across = np.abs(dy * math.cos(yaw) - dx * math.sin(yaw))
    gap = config.beside
    tcp_z = -math.inf
    for inner, outer, half_width, height in (
        (width / 2.0, opening / 2.0 + FINGER_THICKNESS, FINGER_HALF_WIDTH, -FINGERTIP_BELOW_TCP),
        (width / 2.0, opening / 2.0 + MOUNT_THICKNESS, FINGER_HALF_WIDTH, MOUNT_ABOVE_TCP),
        (0.0, HAND_HALF_LENGTH, HAND_HALF_WIDTH, PALM_ABOVE_TCP),
    ):
        under = cells.seen & (across < half_width + gap) & (along > inner - gap) & (along < outer + gap)
        tcp_z = max(tcp_z, _highest(cells.top[under]) - height + config.finger_clearance)
    return tcp_z


def _highest(heights: FloatArray) -> float:
    """The highest of some heights but for lone noise; -inf of none [m]."""
    return float(np.partition(heights, -3)[-3]) if heights.size >= 3 else -math.inf
