"""The release: the object just above what is seen at the place, the opened fingers beside that."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy import ndimage

from cliport_core.pose import PlanarPose
from cliport_core.workspace import WorkspaceSpec
from panda_executor.grasp import Grasp
from panda_executor.ground_cells import BoolArray, GroundCells, points_near
from panda_model.limits import FloatArray


@dataclass(frozen=True)
class PlacementConfig:
    """Settings of the release, lengths in m.

    release_gap: left under the object; margins: how much wider than the object the fingers may open, the best
    first; min_gain: a worse one is taken when the hand then goes lower by this much for it; finger_clearance:
    between the fingertips and what they would stand on; side_clearance: between the fingers and what is higher;
    pixels: edge of the square seen.
    """

    release_gap: float = 0.003
    margins: tuple[float, ...] = (0.02, 0.016, 0.012)
    min_gain: float = 0.002
    finger_clearance: float = 0.004
    side_clearance: float = 0.004
    pixels: int = 96


@dataclass(frozen=True)
class Placement:
    """The pose at which the object is let go: tcp height and the fingers' opening there [m], yaw of the jaws [rad].

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
    """Find the lowest release at which the fingers open without touching what stands there.

    Args:
        cloud: (N, 3) [m, base frame], NaN allowed, without the points of the grasped object itself.
        place: where the object's centroid goes; yaw: of the jaws there [rad].

    What is seen under the object's footprint, turned as it will be, lifts it. What is seen where the fingers
    open (a bowl's rim, a box's wall) lifts the hand: the object then falls the rest of the way. Fingers that open
    less may go lower between things.
    """
    config, hand = config or PlacementConfig(), grasp.hand
    half = config.pixels / 2.0 * workspace.pixel_size
    near = cloud[points_near(cloud, place.x, place.y, half)]
    cells = GroundCells.around(near, workspace, place.x, place.y, config.pixels, (table_z - 0.03, workspace.z_max))
    under = cells.top[_under(cells, place, grasp, yaw - grasp.yaw)]
    support_z = max(float(np.percentile(under, 95.0)) if under.size else table_z, table_z)
    below = max(grasp.tcp_z - grasp.support_z, hand.fingertip_below_tcp)
    least = support_z + below + config.release_gap
    chosen: tuple[float, float] | None = None
    for margin in config.margins:
        opening = min(grasp.width + margin, hand.opening)
        tcp_z = max(least, _above_surroundings(cells, place, yaw, grasp, opening, config))
        if chosen is None or tcp_z < chosen[0] - config.min_gain:
            chosen = tcp_z, opening
    assert chosen is not None  # there are margins
    return Placement(place.x, place.y, chosen[0], yaw, chosen[1], support_z, chosen[0] - least)


def _under(cells: GroundCells, place: PlanarPose, grasp: Grasp, turn: float) -> BoolArray:
    """Return the cells seen under the object, turned by `turn` [rad] from where it was grasped."""
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
    cells: GroundCells, place: PlanarPose, yaw: float, grasp: Grasp, opening: float, config: PlacementConfig
) -> float:
    """Return the lowest tcp [m] at which the hand, opening from the grasp's width, is above everything seen."""
    hand, width = grasp.hand, grasp.width
    dx, dy = cells.x - place.x, cells.y - place.y
    along = np.abs(dx * math.cos(yaw) + dy * math.sin(yaw))
    across = np.abs(dy * math.cos(yaw) - dx * math.sin(yaw))
    gap = config.side_clearance
    tcp_z = -math.inf
    for inner, outer, half_width, height in (
        (width / 2.0, opening / 2.0 + hand.finger_thickness, hand.finger_half_width, -hand.fingertip_below_tcp),
        (width / 2.0, opening / 2.0 + hand.mount_thickness, hand.finger_half_width, hand.mount_above_tcp),
        (0.0, hand.palm_half_length, hand.palm_half_width, hand.palm_above_tcp),
    ):
        under = cells.seen & (across < half_width + gap) & (along > inner - gap) & (along < outer + gap)
        tcp_z = max(tcp_z, _highest(cells.top[under]) - height + config.finger_clearance)
    return tcp_z


def _highest(heights: FloatArray) -> float:
    """Return the highest of some heights but for lone noise [m]; -inf of none."""
    return float(np.partition(heights, -3)[-3]) if heights.size >= 3 else -math.inf
