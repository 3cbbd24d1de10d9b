"""Inverse kinematics for the hand pointing down: damped least squares from several seeds."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from scipy.linalg.lapack import dposv

from cliport_core.pose import Pose
from panda_executor.errors import InverseKinematicsError
from panda_executor.model import PandaModel
from panda_model.limits import FloatArray

_POSITION_TOLERANCE = 1e-5  # [m]
_ANGLE_TOLERANCE = 1e-5  # [rad]
_LIMIT_MARGIN = 0.02  # solutions keep this far from the joint limits [rad]
_MAX_STEP = 0.4  # of a joint in one iteration [rad]
_EYE6 = np.eye(6)
_ELBOWS = (0.0, 0.5, -0.5, 1.1, -1.1)  # turns of joint 3 that solutions are looked for from [rad]
_MANY_ELBOWS = (*_ELBOWS, 0.25, -0.25, 0.8, -0.8, 1.5, -1.5, 2.0, -2.0)
_DRAWN = 40  # further seeds where solutions are looked for finely
_OTHER_SEEDS = 2  # tried in any case: the reference, and the ready pose turned towards the target
_RESTARTS = 60  # random seeds, tried only while nothing else has converged


def tilted(pose: Pose, angle: float) -> Pose:
    """Return the tcp pose turned about the tcp so that the hand leans away from the robot by `angle` [rad]."""
    x, y, _ = pose.translation
    bearing = math.atan2(float(y), float(x))
    axis = np.array([-math.sin(bearing), math.cos(bearing), 0.0])
    return Pose(pin.exp3(axis * angle) @ pose.rotation, pose.translation)


def hand_down_pose(x: float, y: float, z: float, yaw: float) -> Pose:
    """Return tcp in base with the hand pointing straight down.

    The jaws' convention: at yaw 0 the fingers close along the base's x axis; at yaw psi along that direction
    turned by psi about +z. So a block with yaw psi is held by two of its faces. The fingers close along the
    tcp's y axis, and psi and psi + pi describe the same grasp with the hand turned around.
    """
    c, s = math.cos(yaw), math.sin(yaw)
    rotation = np.array([[-s, c, 0.0], [c, s, 0.0], [0.0, 0.0, -1.0]])
    return Pose(rotation, np.array([x, y, z]))


def yaw_of_hand(pose: Pose) -> float:
    """Return the yaw [rad] that `hand_down_pose` was given."""
    return math.atan2(pose.rotation[1, 1], pose.rotation[0, 1])


@dataclass(frozen=True, eq=False)
class IkSolution:
    """Joint positions (7,) [rad] and their cost: less is better."""

    positions: FloatArray
    cost: float


class HandDownIk:
    """Solves for tcp poses; deterministic: the same target and reference give the same answer.

    Args:
        damping: of the least squares; large enough to pass singular poses, small enough to converge fast.
        max_iterations: per seed.
    """

    def __init__(self, model: PandaModel, damping: float = 0.02, max_iterations: int = 60) -> None:
        self._model = model
        self._limits = model.limits.shrunk(_LIMIT_MARGIN)
        self._damping = damping
        self._max_iterations = max_iterations
        self._span = model.limits.upper - model.limits.lower

    def refine(self, target: Pose, seed: FloatArray) -> tuple[FloatArray, float]:
        """Descend from one seed (7,) [rad] to the target; return the positions reached and the error left [m + rad]."""
        goal = pin.SE3(np.array(target.rotation), np.array(target.translation))
        lower, upper = self._limits.lower, self._limits.upper
        q = np.clip(seed, lower, upper)
        damping = self._damping**2 * _EYE6
        residual = math.inf
        for _ in range(self._max_iterations):
            error, jacobian = self._model.tcp_error_and_jacobian(q, goal)
            position_error = math.sqrt(error[:3].dot(error[:3]))
            angle_error = math.sqrt(error[3:].dot(error[3:]))
            residual = position_error + angle_error
            if position_error < _POSITION_TOLERANCE and angle_error < _ANGLE_TOLERANCE:
                break
            # (J J^T + lambda^2 I), lambda fading with the error so that the last steps converge quadratically
            weight = min(1.0, residual * 10.0) + 1e-4
            # positive definite: Cholesky, and without the checks that cost more than solving six equations
            step = jacobian.T @ dposv(jacobian @ jacobian.T + weight * damping, error)[1]
            largest = float(np.abs(step).max())
            if largest > _MAX_STEP:
                step *= _MAX_STEP / largest
            moved = np.minimum(np.maximum(q + step, lower), upper)
            if float(np.abs(moved - q).max()) < 1e-9:
                break
            q = moved
        return q, residual

    def solve_near(self, target: Pose, seed: FloatArray, max_change: float = 0.5) -> FloatArray | None:
        """Return the solution on the seed's own branch, or None when a joint moves more than max_change [rad]."""
        q, residual = self.refine(target, seed)
        if residual > _POSITION_TOLERANCE + _ANGLE_TOLERANCE or float(np.abs(q - seed).max()) > max_change:
            return None
        return q

    def solve_all(self, target: Pose, reference: FloatArray, finely: bool = False) -> list[IkSolution]:
        """Return distinct solutions, the cheapest first: near to `reference` (7,) [rad] and far from the limits.

        finely: from more of the elbow's positions, and from drawn ones.

        Raises:
            InverseKinematicsError: when no seed converges.
        """
        found: list[IkSolution] = []
        best_residual = math.inf
        elbows = _MANY_ELBOWS if finely else _ELBOWS
        enough = len(elbows) + _OTHER_SEEDS + (_DRAWN if finely else 0)
        for number, seed in enumerate(self._seeds(target, reference, elbows)):
            if found and number >= enough:
                break
            q, residual = self.refine(target, seed)
            best_residual = min(best_residual, residual)
            if residual > _POSITION_TOLERANCE + _ANGLE_TOLERANCE:
                continue
            if any(float(np.abs(q - other.positions).max()) < 0.05 for other in found):
                continue
            found.append(IkSolution(q, self.cost(q, reference)))
        if not found:
            x, y, z = (float(v) for v in target.translation)
            raise InverseKinematicsError(x, y, z, yaw_of_hand(target), best_residual)
        return sorted(found, key=lambda solution: solution.cost)

    def near_cost(self, target: Pose, reference: FloatArray) -> float:
        """Return the cost of the target: of what is found from `reference` (7,) [rad] on, else of the cheapest at all.

        Infinite where nothing is found.
        """
        q, residual = self.refine(target, reference)
        if residual <= _POSITION_TOLERANCE + _ANGLE_TOLERANCE:
            return self.cost(q, reference)
        try:
            return self.solve_all(target, reference)[0].cost
        except InverseKinematicsError:
            return math.inf

    def cost(self, positions: FloatArray, reference: FloatArray) -> float:
        """Return the distance from the reference plus a penalty that grows towards the joint limits."""
        distance = float(np.linalg.norm(positions - reference))
        to_limit = np.minimum(positions - self._model.limits.lower, self._model.limits.upper - positions)
        crowded = np.clip(1.0 - to_limit / (0.15 * self._span), 0.0, 1.0)
        return distance + 1.5 * float(np.sum(crowded**2))

    def _seeds(self, target: Pose, reference: FloatArray, elbows: tuple[float, ...]) -> Iterator[FloatArray]:
        """Yield the reference, then configurations turned towards the target with the wrist at its yaw."""
        x, y, _z = target.translation
        bearing = math.atan2(float(y), float(x))
        reach = float(np.clip((math.hypot(float(x), float(y)) - 0.3) / 0.45, 0.0, 1.0))
        folded = np.array([0.0, -0.2, 0.0, -2.6, 0.0, 2.4, 0.0])
        stretched = np.array([0.0, 0.95, 0.0, -1.1, 0.0, 2.05, 0.0])
        base = folded + reach * (stretched - folded)
        base[0] = bearing
        # At joint 7 = pi/4 with the other joints in a plane, the fingers close across that plane.
        wrist = math.pi / 4.0 + bearing - (yaw_of_hand(target) - math.pi / 2.0)
        wrist = (wrist - math.pi / 4.0 + math.pi) % (2.0 * math.pi) - math.pi + math.pi / 4.0
        seeds = [np.array(reference, dtype=np.float64)]
        for elbow in elbows:
            seed = base.copy()
            seed[0] -= elbow * 0.7
            seed[2] = elbow
            seed[6] = np.clip(wrist, self._limits.lower[6], self._limits.upper[6])
            seeds.append(seed)
        ready = self._model.arm.ready.copy()
        ready[0] = bearing
        seeds.append(ready)
        assert len(seeds) == len(elbows) + _OTHER_SEEDS
        # Close to the base, between table and shoulder, only a twisted arm folds far enough.
        twisted = np.array([1.0, 0.22, -1.15, -2.69, -2.6, 3.55, 1.7])
        mirror = np.array([-1.0, 1.0, -1.0, 1.0, -1.0, 1.0, 1.0])
        yield from (*seeds, twisted, twisted * mirror)
        random = np.random.default_rng(0)
        lower, upper = self._limits.lower, self._limits.upper
        for _ in range(_RESTARTS):
            yield random.uniform(lower, upper)
