"""The motions of a pick and place with one grasp, held one way round."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from cliport_core.action import PickPlaceAction
from cliport_core.pose import PlanarPose
from cliport_core.workspace import WorkspaceSpec
from panda_executor.errors import BudgetSpentError, ExecutorError, InverseKinematicsError, PlanningError
from panda_executor.grasp import Grasp
from panda_executor.hand_geometry import HandShape
from panda_executor.ik import hand_down_pose, tilted
from panda_executor.motions import Motion, MotionBuilder
from panda_executor.obstacle_grid import ObstacleGrid
from panda_executor.phase import Phase
from panda_executor.placement import Placement, plan_placement
from panda_executor.scene import Scene
from panda_model.limits import FloatArray

_RELEASE_STEP = 0.005  # between two heights of the release that are tried [m]
_RELEASE_RAISE = 0.05  # the object may be let go this much higher than wished [m]
_MAX_BRANCHES = 4  # of the inverse kinematics that are tried for one pose
_NO_APPROACH = "no approach to the object is free"


@dataclass(frozen=True, eq=False)
class PickPlacePlan:
    """Seven motions, the last of which is in two parts: up, and away to the ready pose."""

    grasp: Grasp
    placement: Placement
    go_above: Motion
    descend: Motion
    raise_up: Motion
    carry: Motion
    lower: Motion
    leave: Motion
    retreat: Motion

    @property
    def motions(self) -> tuple[Motion, ...]:
        """All motions in the order in which they are executed."""
        return (
            self.go_above, self.descend, self.raise_up, self.carry, self.lower, self.leave, self.retreat
        )  # fmt: skip


@dataclass(frozen=True)
class _Target:
    """A pose of the hand pointing down: tcp x, y, z [m, base frame] and yaw [rad]; above_z: where it begins [m]."""

    x: float
    y: float
    z: float
    above_z: float
    yaw: float


@dataclass(frozen=True, eq=False)
class _Approach:
    """A branch of the arm above a pose, and the straight motion down to it."""

    above: FloatArray
    down: Motion


@dataclass(frozen=True, eq=False)
class _Scenes:
    """The scene of each motion: its obstacles, and the hand with what it holds.

    coming: to the object, still among the obstacles; opened: down to it; carried: with it, close to other things;
    carried_wide: with it and clearance; released: the fingers opened at the place; leaving: the empty hand.
    """

    coming: Scene
    opened: Scene
    carried: Scene
    carried_wide: Scene
    released: Scene
    leaving: Scene


class TransferAttempts:
    """Tries grasps for one action.

    Args:
        grid: columns of the cloud.
        start: where the arm is (7,) [rad].
    """

    def __init__(
        self,
        motions: MotionBuilder,
        action: PickPlaceAction,
        workspace: WorkspaceSpec,
        grid: ObstacleGrid,
        start: FloatArray,
    ) -> None:
        self._motions, self._config = motions, motions.config
        self._action, self._workspace, self._grid, self._start = action, workspace, grid, start

    def plan(self, grasp: Grasp, flip: float, rest: npt.NDArray[np.float32], rest_grid: ObstacleGrid) -> PickPlacePlan:
        """Plan every motion with one grasp.

        Args:
            flip: 0 or pi, the gripper turned around [rad].
            rest: the cloud (N, 3) without the object; rest_grid: its columns.

        Raises:
            ExecutorError: names the last motion that failed.
        """
        turn = self._action.place.yaw - self._action.pick.yaw
        grasp, placement = self._lowest_release(grasp, grasp.yaw + flip + turn, rest)
        loaded = HandShape(self._config.hand, grasp.width, grasp.held(flip))
        placement = self._clear_placement(placement, rest_grid, loaded)
        above_z = max(grasp.tcp_z, placement.tcp_z) + self._config.approach_height
        x, y = float(grasp.centroid[0]), float(grasp.centroid[1])
        pick_at = _Target(x, y, grasp.tcp_z, above_z, grasp.yaw + flip)
        place_at = _Target(placement.x, placement.y, placement.tcp_z, above_z, placement.yaw)
        scenes = self._scenes(grasp, placement, loaded, rest_grid)
        reason = _NO_APPROACH
        for pick in self._approaches(Phase.DESCEND, pick_at, scenes.opened, self._start):
            try:
                go_above = self._motions.travel(Phase.GO_ABOVE_PICK, self._start, pick.above, scenes.coming)
                raise_up = self._motions.reversed(Phase.RAISE, pick.down, scenes.carried)
            except BudgetSpentError:
                raise
            except ExecutorError as error:
                reason = str(error)
                continue
            for place in self._approaches(Phase.LOWER, place_at, scenes.carried, pick.above):
                try:
                    carry, leave, retreat = self._after_pick(pick, place, scenes)
                except BudgetSpentError:
                    raise
                except ExecutorError as error:
                    reason = str(error)
                    continue
                return PickPlacePlan(grasp, placement, go_above, pick.down, raise_up, carry, place.down, leave, retreat)
            reason = reason if reason != _NO_APPROACH else "no way down at the place"
        raise PlanningError(reason)

    def _after_pick(self, pick: _Approach, place: _Approach, scenes: _Scenes) -> tuple[Motion, Motion, Motion]:
        """Plan the way to the place, up from it, and to the ready pose."""
        ready = self._motions.model.arm.ready
        carry = self._motions.travel(Phase.CARRY, pick.above, place.above, scenes.carried_wide)
        leave = self._motions.reversed(Phase.RETREAT, place.down, scenes.released)
        retreat = self._motions.travel(Phase.RETREAT, place.above, ready, scenes.leaving)
        return carry, leave, retreat

    def _scenes(self, grasp: Grasp, placement: Placement, loaded: HandShape, rest_grid: ObstacleGrid) -> _Scenes:
        hand, clearance = self._config.hand, self._config.clearance
        travelling = HandShape(hand, margin=clearance)
        loaded_wide = HandShape(hand, grasp.width, loaded.held, clearance)
        return _Scenes(
            coming=self._motions.scene(self._grid, travelling),
            opened=self._motions.scene(rest_grid, HandShape(hand, grasp.opening)),
            carried=self._motions.scene(rest_grid, loaded),
            carried_wide=self._motions.scene(rest_grid, loaded_wide),
            released=self._motions.scene(rest_grid, HandShape(hand, placement.opening)),
            leaving=self._motions.scene(rest_grid, travelling),
        )

    def _lowest_release(self, grasp: Grasp, yaw: float, cloud: npt.NDArray[np.float32]) -> tuple[Grasp, Placement]:
        """Return grasp and placement: fingers without clearance at the place hold the object nearer to its top."""
        placement = self._placement(grasp, yaw, cloud)
        if placement.fall > self._config.placement.min_gain and grasp.spare > 0.0:
            grasp = grasp.raised(placement.fall)
            placement = self._placement(grasp, yaw, cloud)
        return grasp, placement

    def _placement(self, grasp: Grasp, yaw: float, cloud: npt.NDArray[np.float32]) -> Placement:
        config = self._config
        at = self._action.place if config.centre_grasp else _with_offset(self._action, grasp)
        return plan_placement(cloud, at, yaw, grasp, self._workspace, config.scene.table_z, config.placement)

    def _clear_placement(self, placement: Placement, grid: ObstacleGrid, loaded: HandShape) -> Placement:
        """Return the placement, raised until hand, load and opened fingers are out of the columns.

        The hand comes straight down on columns: if its lowest pose is free, so is the way to it.
        """
        opened = HandShape(self._config.hand, placement.opening)
        scenes = [self._motions.scene(grid, loaded), self._motions.scene(grid, opened)]
        for step in range(int(_RELEASE_RAISE / _RELEASE_STEP) + 1):
            z = placement.tcp_z + step * _RELEASE_STEP
            pose = hand_down_pose(placement.x, placement.y, z, placement.yaw)
            if all(scene.hand_is_clear(pose.rotation, pose.translation) for scene in scenes):
                return replace(placement, tcp_z=z)
        raise PlanningError(
            f"no room for hand and object at the place ({placement.x:.3f}, {placement.y:.3f}) m, "
            f"even {_RELEASE_RAISE * 100:.0f} cm higher"
        )

    def _approaches(self, phase: Phase, target: _Target, scene: Scene, reference: FloatArray) -> Iterator[_Approach]:
        """Yield branches above a pose from which a straight motion leads down to it; upright ones first.

        Close to its base the arm cannot fold enough to keep the hand upright at every height: there it leans
        outwards above the object and rights itself on the way down.
        """
        goal = hand_down_pose(target.x, target.y, target.z, target.yaw)
        for lean in self._config.lean:
            self._motions.budget.check()
            above_pose = tilted(hand_down_pose(target.x, target.y, target.above_z, target.yaw), lean)
            try:
                solutions = self._motions.ik.solve_all(above_pose, reference)
            except InverseKinematicsError:
                continue
            found = False
            for solution in solutions[:_MAX_BRANCHES]:
                if not scene.is_valid(solution.positions):
                    continue
                down = self._motions.straight(phase, solution.positions, goal, scene)
                if down is not None:
                    found = True
                    yield _Approach(solution.positions, down)
            if found:
                return


def _with_offset(action: PickPlaceAction, grasp: Grasp) -> PlanarPose:
    """Return where the grasp's middle goes when everything moves as the pick pose is carried onto the place pose."""
    x, y = float(grasp.centroid[0]), float(grasp.centroid[1])
    return action.place @ action.pick.inverse() @ PlanarPose(x, y, action.pick.yaw)
