"""Where to close the fingers: the centroid of the cloud around the pick (paper, appendix D)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy import ndimage

from cliport_perception.pose import PlanarPose
from cliport_perception.workspace import WorkspaceSpec
from panda_executor.errors import GraspError
from panda_executor.ground_cells import BoolArray, GroundCells, points_near
from panda_executor.hand_geometry import (
    FINGER_HALF_WIDTH,
    FINGER_THICKNESS,
    FINGERTIP_BELOW_TCP,
    MAX_OPENING,
    PALM_ABOVE_TCP,
    HeldObject,
)
from panda_executor.limits import FloatArray

_STANDING = 0.005  # tolerance under a standing object [m]
_SURROUNDINGS = 52  # pixels: wide enough for the opened fingers beside the object


@dataclass(frozen=True)
class GraspConfig:
    """Lengths in m.

    crop_pixels: edge of the square around the pick; finger_height: how far below its top an object is looked
    at; min_height: what rises less above the table is flat; seed_reach: how far the object may be from the
    pick; slack: free space that each finger needs beside the object; tip_clearance: fingertips to table;
    min_insertion: the tcp is at least this far below the object's top, where it is tall enough.
    """

    crop_pixels: int = 32
    finger_height: float = 0.0185
    min_height: float = 0.008
    seed_reach: float = 0.02
    slack: float = 0.0025
    tip_clearance: float = 0.005
    min_insertion: float = 0.015
    palm_clearance: float = 0.005
    finger_margin: float = 0.002


@dataclass(frozen=True, eq=False)
class Grasp:
    """A grasp of the object at the pick, in the base frame [m, rad].

    centroid: (3,) of the seen part; tcp_z: height of the tcp; yaw: of the jaws; opening: of the fingers on
    the way down; width: of the object along the closing direction; length: across it; support_z: what
    the object stands on; top_z: its highest part; footprint: (N, 2) its cells relative to the centroid.
    """

    centroid: FloatArray
    tcp_z: float
    yaw: float
    opening: float
    width: float
    length: float
    support_z: float
    top_z: float
    footprint: FloatArray
    cell: float

    @property
    def held(self) -> HeldObject:
        """The object as a box between the fingers."""
        return HeldObject(
            half_x=self.length / 2.0,
            half_y=self.width / 2.0,
            # It starts out touching what it stands on: that must not count as a collision.
            below=max(self.tcp_z - self.support_z - _STANDING, FINGERTIP_BELOW_TCP),
            above=max(self.top_z - self.tcp_z, 0.0),
        )

    def covers(self, points: npt.NDArray[np.float32], margin: float) -> BoolArray:
        """Which points (N, 3) belong to the object: within `margin` [m] of its cells, seen from above."""
        # A mask around the footprint's cells makes the look-up independent of their number.
        reach = float(np.abs(self.footprint).max()) + margin + self.cell
        n = math.ceil(2.0 * reach / self.cell) + 1
        mask = np.zeros((n, n), dtype=bool)
        steps = math.ceil(margin / self.cell)
        index = np.floor((self.footprint + reach) / self.cell).astype(np.int64)
        for i in range(-steps, steps + 1):
            for j in range(-steps, steps + 1):
                mask[np.clip(index[:, 1] + i, 0, n - 1), np.clip(index[:, 0] + j, 0, n - 1)] = True
        with np.errstate(invalid="ignore"):
            relative = points[:, :2] - self.centroid[:2]
            near = np.all(np.abs(relative) < reach, axis=1)
            inside = np.zeros(len(points), dtype=bool)
            cells = np.floor((relative[near] + reach) / self.cell).astype(np.int64)
        cells = np.clip(cells, 0, n - 1)
        inside[near] = mask[cells[:, 1], cells[:, 0]]
        return inside & (points[:, 2] > self.support_z + 0.002)


def plan_grasps(
    cloud: npt.NDArray[np.float32],
    pick: PlanarPose,
    workspace: WorkspaceSpec,
    table_z: float = 0.0,
    config: GraspConfig | None = None,
) -> list[Grasp]:
    """Grasps for the object at the pick, best first: at the pick's yaw, and across when that is blocked.

    The cloud (N, 3) [m, base frame] may hold NaN. Each ground cell counts once, whatever number of points it
    holds, so that the side which faces a tilted camera does not pull the centroid.

    Raises:
        GraspError: when nothing is seen, nothing stands there, it is too wide, or the fingers find no room.
    """
    config = config or GraspConfig()
    where = f"the pick ({pick.x:.3f}, {pick.y:.3f}) m"
    near = cloud[points_near(cloud, pick.x, pick.y, _SURROUNDINGS / 2.0 * workspace.pixel_size)]
    cells = GroundCells.around(near, workspace, pick.x, pick.y, _SURROUNDINGS, (table_z - 0.03, workspace.z_max))
    if not (cells.seen & cells.central(config.crop_pixels)).any():
        raise GraspError(f"no depth was seen around {where}; is the view blocked?")
    top, lowest, part = _object_at(cells, pick, table_z, config, where)
    graspable = GroundCells.around(near, workspace, pick.x, pick.y, _SURROUNDINGS, (lowest, top + 0.01))
    weight = part & graspable.seen
    centroid = np.array([cells.x[weight].mean(), cells.y[weight].mean(), graspable.mean[weight].mean()])
    support_z = _support_below(cells, part, table_z)
    grasps = []
    problem = ""
    for turn in (0.0, math.pi / 2.0):
        try:
            grasps.append(_grasp_at(cells, part, centroid, pick.yaw + turn, support_z, top, table_z, config, where))
        except GraspError as error:
            problem = problem or str(error)
    if not grasps:
        raise GraspError(problem)
    return grasps


def _object_at(
    cells: GroundCells, pick: PlanarPose, table_z: float, config: GraspConfig, where: str
) -> tuple[float, float, BoolArray]:
    """The top of the object [m], the lowest height looked at [m], and the object's cells in between."""
    raised = cells.seen & cells.central(config.crop_pixels)
    raised &= np.nan_to_num(cells.top, nan=-1.0) > table_z + config.min_height
    whole = cells.component(raised, pick.x, pick.y, config.seed_reach)
    if whole is None:
        raise GraspError(f"nothing rises more than {config.min_height * 1000:.0f} mm above the table at {where}")
    distance = np.hypot(cells.x - pick.x, cells.y - pick.y)
    nearest = float(distance[whole].min())
    local = whole & (distance <= nearest + 0.015)
    top = float(np.percentile(cells.top[local], 95.0))
    lowest = max(top - config.finger_height, table_z + config.min_height / 2.0)
    within = whole & (cells.top >= lowest)
    part = cells.component(within, pick.x, pick.y, config.seed_reach + 0.02)
    assert part is not None  # the top itself is within
    if int(part.sum()) < 4:
        raise GraspError(f"only {int(part.sum())} cells of the cloud rise above the table at {where}")
    return top, lowest, part


def _support_below(cells: GroundCells, part: BoolArray, table_z: float) -> float:
    """What the object stands on [m]: the low part of what is seen in a ring around it, else the table."""
    near = ndimage.binary_dilation(part, iterations=5) & ~ndimage.binary_dilation(part, iterations=2)
    ring = cells.top[near & cells.seen]
    if ring.size < 10:
        return table_z
    level = float(np.percentile(ring, 20.0))
    return level if level > table_z + 0.006 else table_z


def _grasp_at(
    cells: GroundCells,
    part: BoolArray,
    centroid: FloatArray,
    yaw: float,
    support_z: float,
    top: float,
    table_z: float,
    config: GraspConfig,
    where: str,
) -> Grasp:
    footprint = np.stack([cells.x[part] - centroid[0], cells.y[part] - centroid[1]], axis=-1)
    closing = np.array([math.cos(yaw), math.sin(yaw)])
    across = np.array([-math.sin(yaw), math.cos(yaw)])
    # Twice the larger side: the fingers stand symmetrically around the centroid.
    width = 2.0 * float(np.percentile(np.abs(footprint @ closing), 98.0)) + cells.cell
    length = 2.0 * float(np.percentile(np.abs(footprint @ across), 98.0)) + cells.cell
    widest = MAX_OPENING - 2.0 * config.slack
    if width > widest:
        raise GraspError(
            f"the object at {where} is {width * 1000:.0f} mm wide between the fingers, "
            f"{widest * 1000:.0f} mm is the most that can be held"
        )
    # Deep enough to hold, not so deep that tips touch the table or the palm touches the top.
    lowest = max(
        table_z + config.tip_clearance + FINGERTIP_BELOW_TCP,
        support_z + config.tip_clearance / 2.0 + FINGERTIP_BELOW_TCP,
        top - PALM_ABOVE_TCP + config.palm_clearance,
    )
    wanted = min(float(centroid[2]), top - config.min_insertion)
    tcp_z = max(wanted, lowest)
    opening = _free_opening(cells, part, centroid, closing, width, tcp_z, config)
    if opening is None:
        raise GraspError(f"there is no room for the fingers beside the object at {where}")
    return Grasp(centroid, tcp_z, yaw, opening, width, length, support_z, top, footprint, cells.cell)


def _free_opening(
    cells: GroundCells,
    part: BoolArray,
    centroid: FloatArray,
    closing: FloatArray,
    width: float,
    tcp_z: float,
    config: GraspConfig,
) -> float | None:
    """The widest opening [m] at which both fingers go down beside the object without touching a neighbour."""
    tips = tcp_z - FINGERTIP_BELOW_TCP - config.finger_margin
    # One cell around the object is its own blurred edge.
    own = ndimage.binary_dilation(part, structure=np.ones((3, 3), dtype=bool))
    blocked = cells.seen & ~own & (np.nan_to_num(cells.top, nan=-1.0) > tips)
    # A neighbour's lone cells are noise: what could stop a finger covers more than one cell.
    blocked &= ndimage.uniform_filter(blocked.astype(float), 3, mode="constant") > 1.5 / 9.0
    dx, dy = cells.x[blocked] - centroid[0], cells.y[blocked] - centroid[1]
    along = np.abs(dx * closing[0] + dy * closing[1])
    across = np.abs(-dx * closing[1] + dy * closing[0])
    in_way = along[across < FINGER_HALF_WIDTH + config.finger_margin]
    smallest = width + 2.0 * config.slack
    for opening in np.arange(MAX_OPENING, smallest - 1e-9, -0.004):
        inner, outer = opening / 2.0, opening / 2.0 + FINGER_THICKNESS
        if not np.any((in_way > inner - config.finger_margin) & (in_way < outer + config.finger_margin)):
            return float(opening)
    return None
