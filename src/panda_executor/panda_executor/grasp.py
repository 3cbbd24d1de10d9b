"""Grasps: the fingers close at the centroid of the cloud around the pick (paper, appendix D)."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from scipy import ndimage

from cliport_core.pose import PlanarPose
from cliport_core.workspace import WorkspaceSpec
from panda_executor.errors import GraspError
from panda_executor.ground_cells import BoolArray, GroundCells, points_near
from panda_executor.hand_geometry import HeldObject
from panda_executor.jaws import Hold, JawConfig, Jaws
from panda_executor.seen_object import SeenObject, find_object
from panda_model import FloatArray, HandModel

OWN_MARGIN = 0.008  # around an object's cells: its blurred edge in the cloud [m]
_SUPPORT_TOLERANCE = 0.005  # tolerance under a standing object [m]


@dataclass(frozen=True)
class GraspConfig(JawConfig):
    """Settings of grasp planning, lengths in m; see also JawConfig.

    pixels: edge of the square around the pick that is looked at, wide enough for the largest object and the
    opened fingers beside it; min_height: what rises less above the table is flat; seed_reach: how far the object
    may be from the pick; feature_reach: how far a narrow feature; whole_preference: the object as a whole is
    taken although a feature is so much nearer to the pick; feature_share: a feature less wide than this share of the
    whole is what is meant; max_length: what is longer across the jaws is held where the pick is; max_offset: a grasp
    is so far from the pick at most.
    """

    pixels: int = 96
    min_height: float = 0.008
    seed_reach: float = 0.02
    feature_reach: float = 0.01
    whole_preference: float = 0.006
    feature_share: float = 0.5
    max_length: float = 0.12
    max_offset: float = 0.04

    @property
    def finger_height(self) -> float:
        """Depth below its top to which an object is looked at [m]: the pads' length (paper, appendix D)."""
        return self.hand.pad_length


@dataclass(frozen=True, eq=False)
class Grasp:
    """A grasp of the object at the pick, in the base frame [m, rad].

    centroid: (3,) of the seen part across the closing direction and in height; along the closing direction it
    is the middle between the fingers' contacts: there the closing fingers do not move the object.
    tcp_z: height of the tcp; yaw: of the jaws; opening: of the fingers on the way down; width: between the
    closed fingers; length: of the whole object across them; support_z: what the object stands on; top_z: its top at
    the pick; highest_z: its highest part, such as a figure's head that is held by its back; footprint: (N, 2) all its
    cells, inner: (M, 2) those without its blurred edge, relative to the centroid; spare: how much higher the tcp could
    be and still hold it; hand: that holds it; high: (K, 2) the inner cells that rise over `half_height`.
    """

    centroid: FloatArray
    tcp_z: float
    yaw: float
    opening: float
    width: float
    length: float
    support_z: float
    top_z: float
    highest_z: float
    footprint: FloatArray
    inner: FloatArray
    cell: float
    spare: float
    hand: HandModel
    high: FloatArray

    @property
    def half_height(self) -> float:
        """Half-way between what the object stands on and its top at the pick [m, base frame]."""
        return _half_way(self.support_z, self.top_z)

    def held(self, flip: float = 0.0) -> HeldObject:
        """Return the object between fingers at `yaw + flip` [rad]."""
        c, s = math.cos(self.yaw + flip), math.sin(self.yaw + flip)
        return HeldObject(
            self.inner @ np.array([[-s, c], [c, s]]),
            # It starts out touching what it stands on: that must not count as a collision.
            below=max(self.tcp_z - self.support_z - _SUPPORT_TOLERANCE, self.hand.fingertip_below_tcp),
            above=max(self.highest_z - self.tcp_z, 0.0),
        )

    def owns(self, points: npt.NDArray[np.float32]) -> BoolArray:
        """Return a mask of the points (N, 3) [m] of the object, its blurred edge too; what is over it is none."""
        return self.covers(points, OWN_MARGIN) & (points[:, 2] < self.highest_z + OWN_MARGIN)  # NaN compares false

    def raised(self, by: float) -> Grasp:
        """Return the same grasp nearer to the object's top, by at most `by` [m]."""
        rise = min(by, self.spare)
        return replace(self, tcp_z=self.tcp_z + rise, spare=self.spare - rise)

    def covers(self, points: npt.NDArray[np.float32], margin: float) -> BoolArray:
        """Return a mask of the points (N, 3) of the object: within `margin` [m] of its cells, seen from above."""
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
            x, y = points[:, 0] - self.centroid[0], points[:, 1] - self.centroid[1]
            near = np.flatnonzero((np.abs(x) < reach) & (np.abs(y) < reach) & (points[:, 2] > self.support_z + 0.002))
            relative = np.stack([x[near], y[near]], axis=1)
            cells = np.floor((relative + reach) / self.cell).astype(np.int64)
        cells = np.clip(cells, 0, n - 1)
        inside = np.zeros(len(points), dtype=bool)
        inside[near] = mask[cells[:, 1], cells[:, 0]]
        return inside


def plan_grasps(
    cloud: npt.NDArray[np.float32],
    pick: PlanarPose,
    workspace: WorkspaceSpec,
    table_z: float = 0.0,
    config: GraspConfig | None = None,
) -> list[Grasp]:
    """Plan grasps of the object at the pick, best first: those at the pick's yaw, then those across.

    At each yaw there may be two: of the object as a whole, at its centroid, and of the narrow feature at the
    pick (a rim, a handle, a bead). The whole comes first unless the pick means the feature: it is on it, and
    away from the middle of the whole.

    The cloud (N, 3) [m, base frame] may hold NaN. Each ground cell counts once, whatever number of points it
    holds, so that the side which faces a tilted camera does not pull the centroid.

    Raises:
        GraspError: when nothing is seen, nothing stands there, it is too wide, or the fingers have no clearance.
    """
    config = config or GraspConfig()
    near = cloud[points_near(cloud, pick.x, pick.y, config.pixels / 2.0 * workspace.pixel_size)]
    cells = GroundCells.around(near, workspace, pick.x, pick.y, config.pixels, (table_z - 0.03, workspace.z_max))
    distance = np.hypot(cells.x - pick.x, cells.y - pick.y)
    if not (cells.seen & (distance < config.max_offset)).any():
        raise GraspError(f"no depth was seen around {_named(pick)}; is the view blocked?")
    problems: list[str] = []
    # What steps divide may still be one: where a part of it gives no grasp, all that is connected may.
    for divided in (True, False):
        seen = find_object(cells, pick, table_z, config.finger_height, config.min_height, config.seed_reach, divided)
        lowest = max(seen.top - config.finger_height, table_z + config.min_height / 2.0)
        graspable = GroundCells.around(near, workspace, pick.x, pick.y, config.pixels, (lowest, seen.top + 0.01))
        height = float(graspable.mean[seen.upper & graspable.seen].mean())
        grasps, problem = _grasps_of(cells, seen, pick, height, table_z, config)
        if grasps:
            return grasps
        problems.append(problem)
    raise GraspError(problems[0])


def _grasps_of(
    cells: GroundCells, seen: SeenObject, pick: PlanarPose, height: float, table_z: float, config: GraspConfig
) -> tuple[list[Grasp], str]:
    """Return the grasps of an object, those at the pick's yaw first, and why the first yaw gives none."""
    where = _named(pick)
    grasps: list[Grasp] = []
    problems: list[str] = []
    for yaw in (pick.yaw, pick.yaw + math.pi / 2.0):
        jaws = Jaws(cells, pick.x, pick.y, yaw, seen.support_z, table_z, config)
        holds, problem = _holds(jaws, seen, height, config, where)
        problems.append(problem)
        for hold in holds:
            grasps.append(_grasp(cells, seen, hold, pick, yaw, height, config.hand))
    return grasps, problems[0]


def _half_way(support_z: float, top_z: float) -> float:
    return (support_z + top_z) / 2.0


def _named(pick: PlanarPose) -> str:
    return f"the pick ({pick.x:.3f}, {pick.y:.3f}) m"


def _holds(jaws: Jaws, seen: SeenObject, height: float, config: GraspConfig, where: str) -> tuple[list[Hold], str]:
    """Return holds of the whole object and of the feature at the pick, the better first, and why there is none."""
    whole = feature = None
    problem = ""
    try:
        whole = jaws.on_object(seen.upper, height, where)
    except GraspError as error:
        problem = str(error)
    try:
        feature = jaws.on_feature(seen.whole, config.feature_reach, height, where)
    except GraspError as error:
        problem = problem or str(error)
    holds = [whole, feature]
    if whole is not None and feature is not None:
        off = abs(whole.across) > config.seed_reach or float(np.ptp(jaws.across[seen.whole])) > config.max_length
        if not off and _is_same(whole, feature):
            holds = [whole]
        elif (
            off
            or feature.width < config.feature_share * whole.width
            or abs(whole.middle) > abs(feature.middle) + config.whole_preference
        ):
            holds = [feature, whole]
    near = [hold for hold in holds if hold is not None and math.hypot(hold.middle, hold.across) <= config.max_offset]
    return near, problem or f"the middle of the object is more than {config.max_offset * 1000:.0f} mm from {where}"


def _is_same(whole: Hold, feature: Hold) -> bool:
    """Return True if the fingers touch the same sides: then the pick is merely off the middle."""
    return abs(whole.middle - feature.middle) < 0.005 and abs(whole.width - feature.width) < 0.01


def _highest(cells: GroundCells, seen: SeenObject) -> float:
    """Return the height of an object's highest part, its top at the pick where all is about as high [m]."""
    highest = float(cells.top[seen.whole & cells.seen].max(initial=seen.top))
    return highest if highest > seen.top + OWN_MARGIN else seen.top


def _grasp(
    cells: GroundCells, seen: SeenObject, hold: Hold, pick: PlanarPose, yaw: float, height: float, hand: HandModel
) -> Grasp:
    c, s = math.cos(yaw), math.sin(yaw)
    x = pick.x + hold.middle * c - hold.across * s
    y = pick.y + hold.middle * s + hold.across * c
    footprint = np.stack([cells.x[seen.whole] - x, cells.y[seen.whole] - y], axis=-1)
    # Thin parts keep their cells, everything else loses its blurred edge.
    core = ndimage.binary_erosion(seen.whole)
    inside = core | (seen.whole & ~ndimage.binary_dilation(core, structure=np.ones((3, 3)), iterations=2))
    inner = np.stack([cells.x[inside] - x, cells.y[inside] - y], axis=-1)
    high = inside & (cells.top > _half_way(seen.support_z, seen.top))
    high = high if high.any() else inside  # its only high part may be as narrow as a blurred edge
    across = np.abs(footprint @ np.array([-s, c]))
    return Grasp(
        centroid=np.array([x, y, height]),
        tcp_z=hold.tips + hand.fingertip_below_tcp,
        yaw=yaw,
        opening=hold.opening,
        width=hold.width,
        length=2.0 * float(np.percentile(across, 98.0)) + cells.cell,
        support_z=seen.support_z,
        top_z=seen.top,
        highest_z=_highest(cells, seen),
        footprint=footprint,
        inner=inner,
        cell=cells.cell,
        spare=hold.spare,
        hand=hand,
        high=np.stack([cells.x[high] - x, cells.y[high] - y], axis=-1),
    )
