"""Rigid transforms: `Pose` in space, `PlanarPose` on the table."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

FloatArray: TypeAlias = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Pose:
    """A rigid transform: `child_in_parent` maps coordinates in child to coordinates in parent.

    rotation: (3, 3) orthonormal; translation: (3,) [m]. Both are copied and made read-only.
    """

    rotation: FloatArray
    translation: FloatArray

    def __post_init__(self) -> None:
        rotation = np.array(self.rotation, dtype=np.float64)
        translation = np.array(self.translation, dtype=np.float64).reshape(-1)
        if rotation.shape != (3, 3) or translation.shape != (3,):
            raise ValueError(f"Pose needs (3, 3) and (3,), got {rotation.shape} and {translation.shape}")
        if not (np.all(np.isfinite(rotation)) and np.all(np.isfinite(translation))):
            raise ValueError("Pose needs finite values")
        if np.abs(rotation @ rotation.T - np.eye(3)).max() > 1e-6 or np.linalg.det(rotation) < 0.0:
            raise ValueError("Pose needs a proper rotation matrix")
        rotation.flags.writeable = False
        translation.flags.writeable = False
        object.__setattr__(self, "rotation", rotation)
        object.__setattr__(self, "translation", translation)

    @classmethod
    def identity(cls) -> Pose:
        """The transform that changes nothing."""
        return cls(np.eye(3), np.zeros(3))

    def __matmul__(self, other: Pose) -> Pose:
        """b_in_a @ c_in_b = c_in_a."""
        return Pose(self.rotation @ other.rotation, self.rotation @ other.translation + self.translation)

    def inverse(self) -> Pose:
        """a_in_b of b_in_a."""
        return Pose(self.rotation.T, -self.rotation.T @ self.translation)

    def apply(self, points: npt.ArrayLike) -> FloatArray:
        """Points (..., 3) of the child frame in the parent frame."""
        result: FloatArray = np.asarray(points, dtype=np.float64) @ self.rotation.T + self.translation
        return result

    def as_matrix(self) -> FloatArray:
        """Homogeneous (4, 4)."""
        matrix = np.eye(4)
        matrix[:3, :3] = self.rotation
        matrix[:3, 3] = self.translation
        return matrix

    def is_close(self, other: Pose, tolerance: float = 1e-9) -> bool:
        """Whether both agree element by element."""
        return bool(
            np.allclose(self.rotation, other.rotation, rtol=0.0, atol=tolerance)
            and np.allclose(self.translation, other.translation, rtol=0.0, atol=tolerance)
        )

    @classmethod
    def from_quaternion_xyzw(cls, quaternion_xyzw: npt.ArrayLike, translation: npt.ArrayLike) -> Pose:
        """From a quaternion (x, y, z, w), normalised here, and a translation (3,) [m].

        Raises:
            ValueError: when the quaternion is zero or not finite.
        """
        q = np.asarray(quaternion_xyzw, dtype=np.float64).reshape(4)
        norm = float(np.linalg.norm(q))
        if not math.isfinite(norm) or norm < 1e-9:
            raise ValueError(f"quaternion {q.tolist()} has no direction")
        x, y, z, w = q / norm
        rotation = np.array(
            [
                [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
            ]
        )
        return cls(rotation, np.asarray(translation, dtype=np.float64))

    def as_quaternion_xyzw(self) -> FloatArray:
        """(4,) unit quaternion (x, y, z, w) with w >= 0."""
        r = self.rotation
        # Bar-Itzhack: the quaternion is the dominant eigenvector of this symmetric matrix.
        k = np.array(
            [
                [r[0, 0] - r[1, 1] - r[2, 2], r[1, 0] + r[0, 1], r[2, 0] + r[0, 2], r[2, 1] - r[1, 2]],
                [0.0, r[1, 1] - r[0, 0] - r[2, 2], r[2, 1] + r[1, 2], r[0, 2] - r[2, 0]],
                [0.0, 0.0, r[2, 2] - r[0, 0] - r[1, 1], r[1, 0] - r[0, 1]],
                [0.0, 0.0, 0.0, r[0, 0] + r[1, 1] + r[2, 2]],
            ]
        )
        _, vectors = np.linalg.eigh(k, UPLO="U")
        q: FloatArray = np.array(vectors[:, -1])
        return -q if q[3] < 0.0 else q

    @classmethod
    def from_xyz_rpy(cls, xyz: npt.ArrayLike, rpy: npt.ArrayLike) -> Pose:
        """From a translation [m] and fixed-axis roll, pitch, yaw [rad] (URDF's rule)."""
        roll, pitch, yaw = (float(v) for v in np.asarray(rpy, dtype=np.float64).reshape(3))
        cr, sr, cp, sp = math.cos(roll), math.sin(roll), math.cos(pitch), math.sin(pitch)
        cy, sy = math.cos(yaw), math.sin(yaw)
        rotation = np.array(
            [
                [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
                [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
                [-sp, cp * sr, cp * cr],
            ]
        )
        return cls(rotation, np.asarray(xyz, dtype=np.float64))

    @classmethod
    def looking_at(cls, eye: npt.ArrayLike, target: npt.ArrayLike) -> Pose:
        """An optical frame (z forward, x right, y down) at `eye` [m], looking at `target`, up along +z."""
        eye_xyz = np.asarray(eye, dtype=np.float64).reshape(3)
        forward = np.asarray(target, dtype=np.float64).reshape(3) - eye_xyz
        forward = forward / np.linalg.norm(forward)
        right = np.cross(forward, [0.0, 0.0, 1.0])
        if np.linalg.norm(right) < 1e-6:  # straight down: image right is -y, so that +x is up in the image
            right = np.array([0.0, -1.0, 0.0])
        right = right / np.linalg.norm(right)
        return cls(np.column_stack([right, np.cross(forward, right), forward]), eye_xyz)


@dataclass(frozen=True)
class PlanarPose:
    """A place on the table: x, y [m] in the base frame and yaw [rad] about its +z."""

    x: float
    y: float
    yaw: float

    def as_pose(self, z: float = 0.0) -> Pose:
        """The same in space, at height z [m], turned about +z."""
        return Pose.from_xyz_rpy((self.x, self.y, z), (0.0, 0.0, self.yaw))

    @classmethod
    def from_pose(cls, pose: Pose) -> PlanarPose:
        """Drop the height; yaw is the heading of the pose's x axis seen from above."""
        yaw = math.atan2(pose.rotation[1, 0], pose.rotation[0, 0])
        return cls(float(pose.translation[0]), float(pose.translation[1]), yaw)
