"""Obstacles: the arm itself, the table, the cameras' posts, and what the cameras saw."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from enum import Enum

import numpy as np
import numpy.typing as npt

from panda_executor.arm_cover import ArmCover, IntArray
from panda_executor.hand_geometry import HandShape
from panda_executor.model import PandaModel
from panda_executor.obstacle_grid import ObstacleGrid
from panda_model.limits import FloatArray

_OVER_TABLE = ("link3", "link4", "link5", "link6", "link7", "hand", "leftfinger", "rightfinger")
_SUNK = 0.005  # depth in the table from which fingertips that were pressed or sagged there may be raised [m]
_SUNK_SPARE = 0.0005  # below where they were measured, for the way's first part [m]
_FREED = (0.01, 0.02, 0.03)  # round a link that touches, one after the other: a reach map rounds up to cells [m]
_LOAD_HANGS_FROM = 5  # joint from which on the links are the hand's neighbours: the load is always below them
_NEAR_CAMERA = ("link2", *_OVER_TABLE)


class UnseenRule(Enum):
    """The rule by which space that no camera saw is free for the arm's links.

    FREE: all of it. SHADOW: not what lies behind something, below a camera's line of sight over it. For the hand and
    its load all of it is free: with one camera, the far side of every object is unseen.
    """

    FREE = "free"
    SHADOW = "shadow"


@dataclass(frozen=True)
class SceneConfig:
    """The fixed surroundings, base frame [m].

    The camera's post stands post_behind it, seen from the robot, down to the table.
    """

    table_z: float = 0.0
    camera_size: float = 0.16
    post_size: float = 0.06
    post_behind: float = 0.08
    fixed_clearance: float = 0.02
    grid_cell: float = 0.005
    floor: float = 0.012  # what rises less above the table is noise of the depth, not an obstacle
    arm_clearance: float = 0.01  # between the arm's links and what was seen
    load_clearance: float = 0.01  # between what is held and the arm, the camera and its post
    own_margin: float = 0.03  # points this near to the arm are its own
    unseen: UnseenRule = UnseenRule.SHADOW


def add_table(model: PandaModel, config: SceneConfig) -> None:
    """Put the table into the model; once per model."""
    table = np.array([3.0, 3.0, 0.5])
    # No clearance to the table: the fingers work millimetres above it, and the heights keep their own.
    centre = np.array([0.5, 0.0, config.table_z - 0.25])
    model.put_fixed_box("table", table, centre, _links(model, _OVER_TABLE), 0.0)


def place_camera(model: PandaModel, config: SceneConfig, position: FloatArray, number: int = 1) -> None:
    """Put a camera and its post into the model, in place of where they stood.

    position: of the optical centre (3,) [m, base frame]; number: of several cameras, from 1.
    """
    name = "camera" if number == 1 else f"camera {number}"
    links = _links(model, _NEAR_CAMERA)
    camera = np.array(position, dtype=np.float64)
    model.put_fixed_box(name, np.full(3, config.camera_size), camera, links, config.fixed_clearance)
    away = camera[:2] / max(float(np.linalg.norm(camera[:2])), 1e-6)
    foot = camera[:2] + away * config.post_behind
    height = max(float(camera[2]) - config.table_z, 0.1)
    model.put_fixed_box(
        f"{name} post",
        np.array([config.post_size, config.post_size, height]),
        np.array([foot[0], foot[1], config.table_z + height / 2.0]),
        links,
        config.fixed_clearance,
    )


def _links(model: PandaModel, names: tuple[str, ...]) -> tuple[str, ...]:
    return tuple(model.link(name) for name in names)


@dataclass(frozen=True, eq=False)
class Scene:
    """Judges configurations: joint limits, self-collision, fixed surroundings, and the cloud's columns.

    The columns are compared with the hand, its fingers and what they hold, and with the arm's links. What is held is
    compared with the arm, the camera and its post, too.
    """

    model: PandaModel
    grid: ObstacleGrid
    hand: HandShape
    table_z: float = 0.0
    config: SceneConfig = field(default_factory=SceneConfig)

    def with_hand(self, hand: HandShape) -> Scene:
        """Return the same surroundings for another opening or load."""
        return replace(self, hand=hand)

    def with_grid(self, grid: ObstacleGrid) -> Scene:
        """Return the same hand among other things."""
        return replace(self, grid=grid)

    def is_valid(self, positions: FloatArray) -> bool:
        """Return True if a configuration (7,) [rad] is within limits and touches nothing."""
        if not self.model.limits.contains(positions, 1e-6) or self.model.in_collision(positions):
            return False
        rotation, translation = self.model.tcp_arrays_now()
        if self._hand_hits(rotation, translation):
            return False
        links = self.model.reaching.placed(self.model.data)
        return self._touching(links) is None and self._load_hits(rotation, translation, links) is None

    def problem(self, positions: FloatArray) -> str | None:
        """Return why a configuration (7,) [rad] is not valid, in words, or None."""
        if not self.model.limits.contains(positions, 1e-6):
            return "a joint limit is exceeded"
        pair = self.model.colliding_pair(positions)
        if pair is not None:
            return f"{pair} would collide"
        rotation, translation = self.model.tcp_arrays(positions)
        if self._hand_hits(rotation, translation):
            x, y, z = translation
            return f"the hand would touch what stands near ({x:.3f}, {y:.3f}, {z:.3f}) m"
        links = self.model.reaching.placed(self.model.data)
        touching = self._touching(links)
        if touching is not None:
            x, y, z = touching[0][0]
            return f"the arm would touch what stands near ({x:.3f}, {y:.3f}, {z:.3f}) m"
        what = self._load_hits(rotation, translation, links)
        return None if what is None else f"what is held would touch {what}"

    def hand_is_clear(self, rotation: FloatArray, translation: FloatArray) -> bool:
        """Return True if the hand with its tcp at (3, 3), (3,) [m, base] stays out of the columns and the table."""
        return not self._hand_hits(rotation, translation)

    def leaving(self, positions: FloatArray) -> Scene:
        """Return the surroundings for a motion that begins at `positions` (7,) [rad], where the arm was measured.

        What the hand touches there it must be able to leave: those columns do not count, nor does the table where the
        fingertips are less than `_SUNK` below it.
        """
        rotation, translation = self.model.tcp_arrays(positions)
        if not self._hand_hits(rotation, translation):
            return self
        points = self.hand.points @ rotation.T + translation
        sunk = min(max(self.table_z - float(points[:, 2].min()), 0.0) + _SUNK_SPARE, _SUNK)
        return replace(self, grid=self.grid.without(points), table_z=self.table_z - sunk)

    def escaping(self, positions: FloatArray) -> Scene:
        """Return the surroundings for the way out after a failure at `positions` (7,) [rad].

        As `leaving`, and the columns that a link touches there do not count, either.
        """
        scene = self.leaving(positions)
        self.model.tcp_arrays(positions)
        links = self.model.reaching.placed(self.model.data)
        for spare in _FREED:
            touching = scene._touching(links)
            if touching is None:
                break
            centres, radii = touching
            scene = scene.with_grid(scene.grid.without_near(centres, radii + spare))
        return scene

    def _touching(self, centres: FloatArray) -> tuple[FloatArray, FloatArray] | None:
        """Return the links' spheres that touch a column, or None where none does.

        centres: of all spheres that reach over the table (M, 3) [m]. Those of them that touch are looked at in parts,
        in smaller spheres that stand out less over the links: returned are the centres (N, 3) [m] of the ones that
        touch, and their radii (N,) with the clearance [m].
        """
        cover, which = self.model.reaching, np.arange(len(centres))
        hit = self._hit(cover, centres, which)
        parts = cover.parts
        if parts is not None and hit.any():
            which = np.flatnonzero(hit[parts.part_of])
            cover, centres = parts, parts.placed(self.model.data, which)
            hit = self._hit(cover, centres, which, finely=True)
        return (centres[hit], cover.radii[which[hit]] + self.config.arm_clearance) if hit.any() else None

    def _hit(
        self, cover: ArmCover, centres: FloatArray, which: IntArray, finely: bool = False
    ) -> npt.NDArray[np.bool_]:
        """Return a mask of `which` of a cover's spheres, their centres (N, 3) [m, base frame], that touch a column."""
        radii = cover.radii + self.config.arm_clearance
        if self.grid.is_below(float((centres[:, 2] - radii[which]).min(initial=np.inf))):
            return np.zeros(len(centres), dtype=bool)
        floor = self.table_z + self.config.floor
        reach = self.grid.reach(radii, floor, self.config.unseen is UnseenRule.SHADOW, finely)
        return reach.hits(centres, radii[which])

    def _load_hits(self, rotation: FloatArray, translation: FloatArray, links: FloatArray) -> str | None:
        """Return what the held object touches of arm and camera, for the kinematics just computed, or None.

        links: centres of the spheres that reach over the table (M, 3) [m].
        """
        if not len(self.hand.load):
            return None
        ball, extent = self.hand.load_ball
        middle = rotation @ ball + translation
        clearance = self.config.load_clearance
        for name, (centre, half) in self.model.fixed_boxes.items():
            if name == "table" or not bool((np.abs(middle - centre) < half + extent).all()):
                continue
            points = self.hand.load @ rotation.T + translation
            if bool((np.abs(points - centre) < half).all(axis=1).any()):
                return f"the {name}"
        standing = self.model.standing.placed(self.model.data)
        for cover, centres in ((self.model.standing, standing), (self.model.reaching, links)):
            radii = cover.radii + clearance
            away = centres - middle
            near = np.einsum("ij,ij->i", away, away) < (radii + extent) ** 2
            near &= cover.joints < _LOAD_HANGS_FROM
            if near.any():
                points = self.hand.load @ rotation.T + translation
                distance = np.linalg.norm(points[:, None] - centres[near], axis=2)
                if bool((distance < radii[near]).any()):
                    return "the arm"
        return None

    def _hand_hits(self, rotation: FloatArray, translation: FloatArray) -> bool:
        heights = self.hand.points @ rotation[2] + translation[2]
        lowest = float(heights.min())
        if lowest < self.table_z:
            return True
        if self.grid.is_below(lowest):
            return False
        low = self.hand.points[heights < self.grid.highest]
        return bool(self.grid.hits(low @ rotation.T + translation).any())
