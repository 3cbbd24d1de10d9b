"""Arm poses that a calibration still lacks: turned and shifted so that they differ from all before."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from cliport_core.pose import Pose
from cliport_perception.calibration.angles import angle_of
from cliport_perception.calibration.board import Board
from cliport_perception.calibration.initial_guess import Placement
from cliport_perception.camera_model import CameraModel


@dataclass(frozen=True)
class ProposalConfig:
    """Proposals around the first pose: turns of the hand [rad] and shifts in the base frame [m].

    border: how much of the picture's width and height stays empty around the board; max_tilt: of the board against the
    line of sight [rad]; both count once a first solution says where the board will be.
    """

    tilts: tuple[float, ...] = (-math.radians(30.0), -math.radians(15.0), 0.0, math.radians(15.0), math.radians(30.0))
    rolls: tuple[float, ...] = (-math.radians(35.0), 0.0, math.radians(35.0))
    shifts: tuple[float, ...] = (-0.08, 0.0, 0.08)
    border: float = 0.03
    max_tilt: float = math.radians(50.0)


def candidate_poses(first: Pose, config: ProposalConfig | None = None) -> list[Pose]:
    """Return all poses that may be proposed around a first one of the gripper, in which the board is seen."""
    config = config or ProposalConfig()
    turns = [
        Rotation.from_rotvec([about_x, about_y, 0.0]) * Rotation.from_rotvec([0.0, 0.0, roll])
        for about_x, about_y, roll in itertools.product(config.tilts, config.tilts, config.rolls)
    ]
    poses = []
    for turn in turns:
        rotation = first.rotation @ turn.as_matrix()
        for shift in itertools.product(config.shifts, repeat=3):
            poses.append(Pose(rotation, first.translation + np.array(shift)))
    return poses


def next_pose(candidates: Sequence[Pose], taken: Sequence[Pose], rng: np.random.Generator, tries: int = 60) -> Pose:
    """Return, of some candidates drawn by chance, the one that differs most from the poses taken."""
    drawn = [candidates[int(i)] for i in rng.choice(len(candidates), size=min(tries, len(candidates)), replace=False)]
    if not taken:
        return drawn[0]
    turns = np.stack([pose.rotation for pose in taken])
    shifts = np.stack([pose.translation for pose in taken])

    def novelty(pose: Pose) -> float:
        # a turn by 20 degrees counts as much as a shift by 100 mm
        turn = angle_of(turns.transpose(0, 2, 1) @ pose.rotation) / math.radians(20.0)
        return float(np.min(turn + np.linalg.norm(shifts - pose.translation, axis=1) / 0.1))

    return max(drawn, key=novelty)


def in_view(
    candidates: Sequence[Pose],
    placement: Placement,
    board: Board,
    camera: CameraModel,
    config: ProposalConfig | None = None,
) -> list[Pose]:
    """Return the candidates at which a placement has the whole board in the picture, turned to the camera."""
    config = config or ProposalConfig()
    kept = []
    for pose in candidates:
        seen = placement.board_in_camera(pose)
        outline = seen.apply(board.outline)
        if outline[:, 2].min() < 0.1:
            continue
        pixels = camera.project(outline) / np.array([camera.height, camera.width])
        sight = seen.apply(board.center)
        tilt = math.acos(min(1.0, max(-1.0, float(seen.rotation[:, 2] @ sight / np.linalg.norm(sight)))))
        if pixels.min() > config.border and pixels.max() < 1.0 - config.border and tilt < config.max_tilt:
            kept.append(pose)
    return kept


def describe_move(current: Pose, wanted: Pose) -> str:
    """Return what a person at the arm has to do to come from one gripper pose to another."""
    shift = wanted.translation - current.translation
    parts = []
    for axis, name in enumerate("xyz"):
        if abs(shift[axis]) >= 0.005:
            parts.append(f"{1e3 * shift[axis]:+.0f} mm along the base's {name}")
    turn = np.degrees(Rotation.from_matrix(current.rotation.T @ wanted.rotation).as_rotvec())
    for axis, name in enumerate("xyz"):
        if abs(turn[axis]) >= 2.0:
            parts.append(f"{turn[axis]:+.0f} degrees about the hand's {name}")
    return "move " + ", ".join(parts) if parts else "stay where you are"


def describe_pose(pose: Pose) -> str:
    """Return a pose of the gripper in the base frame in words."""
    x, y, z = pose.translation
    roll, pitch, yaw = Rotation.from_matrix(pose.rotation).as_euler("xyz")
    return f"({x:.3f}, {y:.3f}, {z:.3f}) m, roll, pitch, yaw ({roll:.2f}, {pitch:.2f}, {yaw:.2f}) rad"
