"""Single motions: a path, its times, and the scene in which it was found valid."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, replace

import numpy as np
import pinocchio as pin

from cliport_core.pose import Pose
from panda_executor.budget import Budget
from panda_executor.config import ExecutorConfig
from panda_executor.errors import PlanningError, TrajectoryError
from panda_executor.hand_geometry import HandShape
from panda_executor.ik import HandDownIk
from panda_executor.model import PandaModel
from panda_executor.obstacle_grid import ObstacleGrid
from panda_executor.path_search import find_path, line_is_free
from panda_executor.phase import Phase
from panda_executor.scene import Scene
from panda_executor.timing import time_path
from panda_executor.trajectory import JointTrajectory
from panda_executor.validation import validate_trajectory
from panda_model.limits import FloatArray, JointLimits

_CARTESIAN_STEP = 0.01  # between two solved poses on a straight line [m]
_TURN_STEP = 0.1  # [rad]
_GLANCE = 0.3  # between two configurations of a line at which a first look is taken [rad]
_BRANCH_CHANGE = 0.35  # a joint that moves more between two solved poses has left its branch [rad]


@dataclass(frozen=True, eq=False)
class Motion:
    """A trajectory for one phase, and the scene (hand, load, obstacles) that it must be checked in.

    straightness: how far the tcp may be off the line from its start to its end [m]; None where there is no line.
    """

    phase: Phase
    trajectory: JointTrajectory
    scene: Scene
    straightness: float | None = None


class MotionBuilder:
    """Makes motions; every one that it returns has passed validate_trajectory in its scene.

    Args:
        budget: of the planning that the motions belong to; every method raises BudgetSpentError once it is spent.
    """

    def __init__(self, model: PandaModel, ik: HandDownIk, config: ExecutorConfig, budget: Budget | None = None) -> None:
        self.model, self.ik, self.config = model, ik, config
        self.budget = budget or Budget()
        self.limits: JointLimits = config.motion_limits(model.limits)

    def scene(self, grid: ObstacleGrid, hand: HandShape) -> Scene:
        """Return the surroundings with the given columns and hand."""
        return Scene(self.model, grid, hand, self.config.scene.table_z, self.config.scene)

    def travel(self, phase: Phase, start: FloatArray, goal: FloatArray, scene: Scene) -> Motion:
        """Plan a motion between configurations (7,) [rad], straight where that is free.

        Raises:
            PlanningError: when there is no way, or none that holds when it is checked as a whole.
        """
        straight = self._straight_in_joints(phase, start, goal, scene)
        if straight is not None:
            return straight
        waypoints = find_path(scene, start, goal, self.config.search, budget=self.budget)
        try:
            if len(waypoints) > 2:
                return self._cornering(phase, waypoints, scene)
            return self._timed(phase, waypoints, scene, self.config.timing.tcp_speed)
        except TrajectoryError as error:
            raise PlanningError(f"the path found does not hold when checked again: {error}") from None

    def _straight_in_joints(self, phase: Phase, start: FloatArray, goal: FloatArray, scene: Scene) -> Motion | None:
        """Plan the straight line in joint space, or return None; the check of the whole motion is the only fine one."""
        self.budget.check()
        if not line_is_free(scene, start, goal, _GLANCE):
            return None
        try:
            return self._timed(phase, np.stack([start, goal]), scene, self.config.timing.tcp_speed)
        except TrajectoryError:
            return None

    def _cornering(self, phase: Phase, waypoints: FloatArray, scene: Scene) -> Motion:
        """Plan round corners without a stop or, where that touches something, with one at each of them."""
        try:
            return self._timed(phase, _rounded(waypoints), scene, self.config.timing.tcp_speed)
        except TrajectoryError:
            return self._stopping(phase, waypoints, scene)

    def straight(
        self, phase: Phase, start: FloatArray, end_pose: Pose, scene: Scene, speed: float | None = None
    ) -> Motion | None:
        """Plan a straight line of the tcp from where `start` (7,) puts it to `end_pose`; None when that fails.

        speed: of the tcp at most [m/s]; that near objects when it is None, and never more than elsewhere.
        """
        waypoints = self.cartesian_waypoints(start, end_pose)
        if waypoints is None or not scene.is_valid(waypoints[-1]):
            return None
        try:
            near = min(speed or self.config.timing.tcp_speed_near, self.config.timing.tcp_speed)
            return self._timed(phase, waypoints, scene, near, self.config.straightness)
        except TrajectoryError:
            return None

    def reversed(self, phase: Phase, motion: Motion, scene: Scene) -> Motion:
        """Return the same way back, with another hand.

        Raises:
            TrajectoryError: when the other hand does not pass.
        """
        self.budget.check()
        forward = motion.trajectory
        back = JointTrajectory(
            forward.joint_names,
            forward.duration - forward.times[::-1],
            forward.positions[::-1].copy(),
            -forward.velocities[::-1],
            forward.accelerations[::-1].copy(),
        )
        validate_trajectory(back, self.limits, scene, motion.straightness)
        return Motion(phase, back, scene, motion.straightness)

    def among(self, motion: Motion, grid: ObstacleGrid) -> Motion:
        """Return the same motion among other columns. Raises TrajectoryError when it does not pass."""
        self.budget.check()
        scene = motion.scene.with_grid(grid)
        validate_trajectory(motion.trajectory, self.limits, scene, motion.straightness)
        return replace(motion, scene=scene)

    def cartesian_waypoints(self, start: FloatArray, end_pose: Pose) -> FloatArray | None:
        """Return configurations (N, 7) along the line, all on the branch of `start`, or None."""
        self.budget.check()
        first = self.model.tcp_pose(start)
        shift = np.asarray(end_pose.translation) - first.translation
        turn = pin.log3(first.rotation.T @ end_pose.rotation)
        steps = max(float(np.linalg.norm(shift)) / _CARTESIAN_STEP, float(np.linalg.norm(turn)) / _TURN_STEP)
        count = max(math.ceil(steps), 2)
        waypoints = [np.array(start, dtype=np.float64)]
        for share in np.arange(1, count + 1) / count:
            pose = Pose(first.rotation @ pin.exp3(turn * share), first.translation + shift * share)
            guess = waypoints[-1]
            if len(waypoints) > 1:
                guess = 2.0 * waypoints[-1] - waypoints[-2]
            solution = self.ik.solve_near(pose, guess, _BRANCH_CHANGE)
            if solution is None:
                return None
            waypoints.append(solution)
        return np.stack(waypoints)

    def _timed(
        self, phase: Phase, waypoints: FloatArray, scene: Scene, tcp_speed: float, straightness: float | None = None
    ) -> Motion:
        if float(np.abs(waypoints[-1] - waypoints[0]).max()) < 1e-4 and len(waypoints) == 2:
            resting = _resting(waypoints[0], self.model.arm.arm_joints)
            validate_trajectory(resting, self.limits, scene)
            return Motion(phase, resting, scene)
        period = self.config.timing.period
        trajectory = time_path(waypoints, self.limits, self.model, tcp_speed, period)
        validate_trajectory(trajectory, self.limits, scene, straightness)
        return Motion(phase, trajectory, scene, straightness)

    def _stopping(self, phase: Phase, waypoints: FloatArray, scene: Scene) -> Motion:
        """Plan leg by leg with a stop at every corner: what is left when the rounded path touches something."""
        timing = self.config.timing
        legs = [
            time_path(np.stack(pair), self.limits, self.model, timing.tcp_speed, timing.period)
            for pair in itertools.pairwise(waypoints)
        ]
        trajectory = _joined(legs)
        validate_trajectory(trajectory, self.limits, scene)
        return Motion(phase, trajectory, scene)


def _joined(legs: list[JointTrajectory]) -> JointTrajectory:
    """Return one trajectory of legs that each begin at rest where the last one ended; corners are kept once."""
    starts = np.concatenate([[0.0], np.cumsum([leg.duration for leg in legs])])
    times, positions, velocities, accelerations = [], [], [], []
    for number, leg in enumerate(legs):
        first = 0 if number == 0 else 1
        times.append(leg.times[first:] + starts[number])
        positions.append(leg.positions[first:])
        velocities.append(leg.velocities[first:])
        accelerations.append(leg.accelerations[first:])
    return JointTrajectory(
        legs[0].joint_names,
        np.concatenate(times),
        np.concatenate(positions),
        np.concatenate(velocities),
        np.concatenate(accelerations),
    )


def _resting(positions: FloatArray, joints: tuple[str, ...]) -> JointTrajectory:
    """Return two points at the same place: a motion for an arm that is already there."""
    still = np.zeros((2, len(positions)))
    return JointTrajectory(joints, np.array([0.0, 0.1]), np.stack([positions] * 2), still, still)


def _rounded(waypoints: FloatArray) -> FloatArray:
    """Return dense points (M, 7) of a polyline whose corners are cut three times, by a quarter, 0.15 rad at most."""
    points = waypoints
    for _ in range(3):
        cut = [points[0]]
        for before, corner, after in zip(points[:-2], points[1:-1], points[2:], strict=True):
            for other in (before, after):
                distance = float(np.linalg.norm(other - corner))
                share = min(0.25, 0.15 / max(distance, 1e-9))
                cut.append(corner + share * (other - corner))
        cut.append(points[-1])
        points = np.stack(cut)
    dense = [points[:1]]
    for a, b in itertools.pairwise(points):
        count = max(math.ceil(float(np.linalg.norm(b - a)) / 0.15), 1)
        dense.append(a + (b - a) * (np.arange(1, count + 1) / count)[:, None])
    return np.concatenate(dense)
