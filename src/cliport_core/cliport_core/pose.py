"""Rigid transforms: `Pose` in space, `PlanarPose` on the table."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

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
        if not all(map(math.isfinite, (*rotation.ravel().tolist(), *translation.tolist()))):
            raise ValueError("Pose needs finite values")
        if not _is_proper(rotation):
            raise ValueError("Pose needs a proper rotation matrix")
        rotation.flags.writeable = False
        translation.flags.writeable = False
        object.__setattr__(self, "rotation", rotation)
        object.__setattr__(self, "translation", translation)

    @classmethod
    def identity(cls) -> Pose:
        """Return the transform that changes nothing."""
        return cls(np.eye(3), np.zeros(3))

    def __matmul__(self, other: Pose) -> Pose:
        """b_in_a @ c_in_b = c_in_a."""
        return Pose(self.rotation @ other.rotation, self.rotation @ other.translation + self.translation)

    def inverse(self) -> Pose:
        """Return a_in_b of b_in_a."""
        return Pose(self.rotation.T, -self.rotation.T @ self.translation)

    def apply(self, points: npt.ArrayLike) -> FloatArray:
        """Return points (..., 3) of the child frame in the parent frame."""
        result: FloatArray = np.asarray(points, dtype=np.float64) @ self.rotation.T + self.translation
        return result

    def as_matrix(self) -> FloatArray:
        """Return the homogeneous matrix (4, 4)."""
        matrix = np.eye(4)
        matrix[:3, :3] = self.rotation
        matrix[:3, 3] = self.translation
        return matrix

    def is_close(self, other: Pose, tolerance: float = 1e-9) -> bool:
        """Return True if both agree element by element, within `tolerance`."""
        return bool(
            np.allclose(self.rotation, other.rotation, rtol=0.0, atol=tolerance)
            and np.allclose(self.translation, other.translation, rtol=0.0, atol=tolerance)
        )

    @classmethod
    def from_quaternion_xyzw(cls, quaternion_xyzw: npt.ArrayLike, translation: npt.ArrayLike) -> Pose:
        """Make a pose of a quaternion (x, y, z, w), normalised here, and a translation (3,) [m].

        Raises:
            ValueError: when the quaternion is zero or not finite.
        """
        q = np.asarray(quaternion_xyzw, dtype=np.float64).reshape(4)
        norm = math.sqrt(q.dot(q))
        if not math.isfinite(norm) or norm < 1e-9:
            raise ValueError(f"quaternion {q.tolist()} has no direction")
        x, y, z, w = (q / norm).tolist()
        rotation = np.array(
            [
                [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
            ]
        )
        return cls(rotation, np.asarray(translation, dtype=np.float64))

    def as_quaternion_xyzw(self) -> FloatArray:
        """Return the unit quaternion (4,), in the order x, y, z, w, with w >= 0."""
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
        """Make a pose of a translation (3,) [m] and fixed-axis roll, pitch, yaw [rad] (URDF's rule)."""
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
        """Return an optical frame (z forward, x right, y down) at `eye` [m], looking at `target` [m], up along +z."""
        eye_xyz = np.asarray(eye, dtype=np.float64).reshape(3)
        forward = np.asarray(target, dtype=np.float64).reshape(3) - eye_xyz
        forward = forward / np.linalg.norm(forward)
        right = np.cross(forward, [0.0, 0.0, 1.0])
        if np.linalg.norm(right) < 1e-6:  # straight down: image right is -y, so that +x is up in the image
            right = np.array([0.0, -1.0, 0.0])
        right = right / np.linalg.norm(right)
        return cls(np.column_stack([right, np.cross(forward, right), forward]), eye_xyz)


def _is_proper(rotation: FloatArray) -> bool:
    """Return whether a finite matrix (3, 3) is a rotation, to 1e-6; NumPy is slow on so few numbers."""
    (a, b, c), (d, e, f), (g, h, i) = rotation.tolist()
    lengths = a * a + b * b + c * c - 1.0, d * d + e * e + f * f - 1.0, g * g + h * h + i * i - 1.0
    products = a * d + b * e + c * f, a * g + b * h + c * i, d * g + e * h + f * i
    if max(map(abs, (*lengths, *products))) > 1e-6:
        return False
    determinant: float = a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g)
    return determinant > 0.0


@dataclass(frozen=True)
class PlanarPose:
    """A rigid transform on the table: x, y [m] in the parent frame (the base's) and yaw [rad] about its +z."""

    x: float
    y: float
    yaw: float

    @classmethod
    def identity(cls) -> PlanarPose:
        """Return the transform that changes nothing."""
        return cls(0.0, 0.0, 0.0)

    def __matmul__(self, other: PlanarPose) -> PlanarPose:
        """b_in_a @ c_in_b = c_in_a; the yaws add up and are not wrapped."""
        x, y = self._turned(other.x, other.y)
        return PlanarPose(self.x + x, self.y + y, self.yaw + other.yaw)

    def inverse(self) -> PlanarPose:
        """Return a_in_b of b_in_a."""
        cos, sin = math.cos(self.yaw), math.sin(self.yaw)
        return PlanarPose(-cos * self.x - sin * self.y, sin * self.x - cos * self.y, -self.yaw)

    def apply(self, points: npt.ArrayLike) -> FloatArray:
        """Return points (..., 2) [m] of the child frame in the parent frame."""
        xy = np.asarray(points, dtype=np.float64)
        x, y = self._turned(xy[..., 0], xy[..., 1])
        return np.stack([self.x + x, self.y + y], axis=-1)

    @property
    def direction(self) -> tuple[float, float]:
        """The child frame's x axis in the parent frame, a unit vector."""
        return math.cos(self.yaw), math.sin(self.yaw)

    def is_finite(self) -> bool:
        """Return True if x, y and yaw are finite."""
        return math.isfinite(self.x) and math.isfinite(self.y) and math.isfinite(self.yaw)

    def _turned(self, x: Any, y: Any) -> tuple[Any, Any]:
        cos, sin = math.cos(self.yaw), math.sin(self.yaw)
        return cos * x - sin * y, sin * x + cos * y

    def as_pose(self, z: float = 0.0) -> Pose:
        """Return the pose in space, at height z [m], turned about +z."""
        return Pose.from_xyz_rpy((self.x, self.y, z), (0.0, 0.0, self.yaw))

    def as_quaternion_xyzw(self) -> tuple[float, float, float, float]:
        """Return the unit quaternion (x, y, z, w) of the turn about +z, with w >= 0."""
        half = math.remainder(self.yaw, 2.0 * math.pi) / 2.0
        return 0.0, 0.0, math.sin(half), math.cos(half)

    @classmethod
    def from_quaternion_xyzw(cls, quaternion_xyzw: Sequence[float], x: float, y: float) -> PlanarPose:
        """Make a pose of a position [m] and a quaternion (x, y, z, w) of any length.

        Yaw is the heading of the turned x axis seen from above.

        Raises:
            ValueError: when the quaternion is zero, or a number is not finite.
        """
        norm = float(np.linalg.norm(quaternion_xyzw))
        if not math.isfinite(norm) or norm < 1e-9:
            raise ValueError(f"quaternion {[float(v) for v in quaternion_xyzw]} has no direction")
        if not (math.isfinite(x) and math.isfinite(y)):
            raise ValueError(f"position ({x}, {y}) is not finite")
        qx, qy, qz, qw = (v / norm for v in quaternion_xyzw)
        return cls(float(x), float(y), math.atan2(2 * (qx * qy + qz * qw), 1 - 2 * (qy * qy + qz * qz)))

    @classmethod
    def from_pose(cls, pose: Pose) -> PlanarPose:
        """Return the pose without its height; yaw is the heading of the pose's x axis seen from above."""
        yaw = math.atan2(pose.rotation[1, 0], pose.rotation[0, 0])
        return cls(float(pose.translation[0]), float(pose.translation[1]), yaw)
