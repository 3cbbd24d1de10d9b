"""Obstacles: the arm itself, the table, the camera's post, and what the camera saw."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from panda_executor.hand_geometry import HandShape
from panda_executor.model import PandaModel
from panda_executor.obstacle_grid import ObstacleGrid
from panda_model.limits import FloatArray

_OVER_TABLE = ("link3", "link4", "link5", "link6", "link7", "hand", "leftfinger", "rightfinger")
_NEAR_CAMERA = ("link2", *_OVER_TABLE)


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


def add_table(model: PandaModel, config: SceneConfig) -> None:
    """Put the table into the model; once per model."""
    table = np.array([3.0, 3.0, 0.5])
    # No clearance to the table: the fingers work millimetres above it, and the heights keep their own.
    centre = np.array([0.5, 0.0, config.table_z - 0.25])
    model.put_fixed_box("table", table, centre, _links(model, _OVER_TABLE), 0.0)


def place_camera(model: PandaModel, config: SceneConfig, position: FloatArray) -> None:
    """Put the camera and its post into the model, in place of where they stood.

    position: of the optical centre (3,) [m, base frame].
    """
    links = _links(model, _NEAR_CAMERA)
    camera = np.array(position, dtype=np.float64)
    model.put_fixed_box("camera", np.full(3, config.camera_size), camera, links, config.fixed_clearance)
    away = camera[:2] / max(float(np.linalg.norm(camera[:2])), 1e-6)
    foot = camera[:2] + away * config.post_behind
    height = max(float(camera[2]) - config.table_z, 0.1)
    model.put_fixed_box(
        "camera post",
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

    The columns are compared with the hand, its fingers and what they hold: those work among the objects. The
    rest of the arm stays above the workspace's z_max in every pose that the hand reaches pointing down.
    """

    model: PandaModel
    grid: ObstacleGrid
    hand: HandShape
    table_z: float = 0.0

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
        # in_collision has just computed the kinematics of `positions`
        rotation, translation = self.model.tcp_arrays(positions)
        return not self._hand_hits(rotation, translation)

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
        return None

    def hand_is_clear(self, rotation: FloatArray, translation: FloatArray) -> bool:
        """Return True if the hand with its tcp at (3, 3), (3,) [m, base] stays out of the columns and the table."""
        return not self._hand_hits(rotation, translation)

    def _hand_hits(self, rotation: FloatArray, translation: FloatArray) -> bool:
        points = self.hand.points @ rotation.T + translation
        if float(points[:, 2].min()) < self.table_z:
            return True
        return bool(self.grid.hits(points).any())
