"""The motions of a pick and place with one grasp, held one way round."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from cliport_core.action import PickPlaceAction
from cliport_core.pose import PlanarPose
from cliport_core.workspace import WorkspaceSpec
from panda_executor.approaches import Approach, Target, more_approaches, pairs, usual_approaches
from panda_executor.errors import BudgetSpentError, ExecutorError, PlanningError
from panda_executor.grasp import Grasp
from panda_executor.hand_geometry import HandShape
from panda_executor.ik import hand_down_pose
from panda_executor.motions import Motion, MotionBuilder
from panda_executor.obstacle_grid import ObstacleGrid
from panda_executor.phase import Phase
from panda_executor.placement import Placement, plan_placement
from panda_executor.scene import Scene
from panda_model.limits import FloatArray

_RELEASE_STEP = 0.005  # between two heights of the release that are tried [m]
_RELEASE_RAISE = 0.05  # the object may be let go this much higher than wished [m]
_NO_APPROACH = "no approach to the object is free"
_NO_WAY_DOWN = "no way down at the place"


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


@dataclass(frozen=True, eq=False)
class Attempt:
    """One grasp, held one way round: its release, where hand and object come from, and which ways were looked for.

    ways: of each phase between two configurations, as bytes, or back up an approach: the motion, or why there is none.
    """

    grasp: Grasp
    placement: Placement
    pick_at: Target
    place_at: Target
    scenes: _Scenes
    ways: dict[tuple[object, ...], Motion | ExecutorError] = field(default_factory=dict)


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
        self._action, self._grid = action, grid
        self.workspace, self.start = workspace, start
        self.begun: list[Attempt] = []  # those whose objects can be let go at the place

    def plan(self, grasp: Grasp, flip: float, rest: npt.NDArray[np.float32], rest_grid: ObstacleGrid) -> PickPlacePlan:
        """Plan every motion with one grasp.

        Args:
            flip: 0 or pi, the gripper turned around [rad].
            rest: the cloud (N, 3) without the object; rest_grid: its columns.

        Raises:
            ExecutorError: names the last motion that failed.
        """
        attempt = self._attempt(grasp, flip, rest, rest_grid)
        self.begun.append(attempt)
        reason, scenes = _NO_APPROACH, attempt.scenes
        for pick in usual_approaches(self._motions, Phase.DESCEND, attempt.pick_at, scenes.opened, self.start):
            for place in usual_approaches(self._motions, Phase.LOWER, attempt.place_at, scenes.carried, pick.above):
                try:
                    return self._joined(attempt, pick, place)
                except BudgetSpentError:
                    raise
                except ExecutorError as error:
                    reason = str(error)
            reason = reason if reason != _NO_APPROACH else _NO_WAY_DOWN
        raise PlanningError(reason)

    def plan_from_anywhere(self, attempt: Attempt) -> PickPlacePlan:
        """Plan what was begun and not found, from every height and branch. Raises ExecutorError as `plan` does."""
        scenes = attempt.scenes
        picks = more_approaches(self._motions, Phase.DESCEND, attempt.pick_at, scenes.opened, self.start)
        places = more_approaches(self._motions, Phase.LOWER, attempt.place_at, scenes.carried, self.start)
        reason = "no way down at the object and the place"
        reached = (pick for pick in picks if scenes.coming.is_valid(pick.above))  # with room to travel to and from
        left = (place for place in places if scenes.carried_wide.is_valid(place.above))
        for pick, place in pairs(reached, left):
            try:
                return self._joined(attempt, pick, place)
            except BudgetSpentError:
                raise
            except ExecutorError as error:
                reason = str(error)
        raise PlanningError(reason)

    def _attempt(self, grasp: Grasp, flip: float, rest: npt.NDArray[np.float32], rest_grid: ObstacleGrid) -> Attempt:
        """Return what the motions with one grasp are to do; arguments as in `plan`.

        Raises:
            ExecutorError: where the object cannot be let go at the place.
        """
        turn = self._action.place.yaw - self._action.pick.yaw
        grasp, placement = self._lowest_release(grasp, grasp.yaw + flip + turn, rest)
        loaded = HandShape(self._config.hand, grasp.width, grasp.held(flip))
        placement = self._clear_placement(placement, rest_grid, loaded)
        above_z = max(grasp.tcp_z, placement.tcp_z) + self._config.approach_height
        x, y = float(grasp.centroid[0]), float(grasp.centroid[1])
        pick_at = Target(x, y, grasp.tcp_z, above_z, grasp.yaw + flip)
        place_at = Target(placement.x, placement.y, placement.tcp_z, above_z, placement.yaw)
        return Attempt(grasp, placement, pick_at, place_at, self._scenes(grasp, placement, loaded, rest_grid))

    def _joined(self, attempt: Attempt, pick: Approach, place: Approach) -> PickPlacePlan:
        """Plan the motions before, between and after both ways down; those that need no search first."""
        scenes, ready = attempt.scenes, self._motions.model.arm.ready
        raise_up = self._back(attempt, Phase.RAISE, pick, scenes.carried)
        leave = self._back(attempt, Phase.RETREAT, place, scenes.released)
        go_above = self._way(attempt, Phase.GO_ABOVE_PICK, self.start, pick.above, scenes.coming)
        carry = self._way(attempt, Phase.CARRY, pick.above, place.above, scenes.carried_wide)
        retreat = self._way(attempt, Phase.RETREAT, place.above, ready, scenes.leaving)
        return PickPlacePlan(
            attempt.grasp, attempt.placement, go_above, pick.down, raise_up, carry, place.down, leave, retreat
        )

    def _way(self, attempt: Attempt, phase: Phase, start: FloatArray, goal: FloatArray, scene: Scene) -> Motion:
        """Return the motion between two configurations (7,) [rad]. Raises ExecutorError as `_found` does."""
        key = phase, start.tobytes(), goal.tobytes()
        return self._found(attempt, key, lambda: self._motions.travel(phase, start, goal, scene))

    def _back(self, attempt: Attempt, phase: Phase, approach: Approach, scene: Scene) -> Motion:
        """Return the way up again after an approach, with another hand. Raises ExecutorError as `_found` does."""
        return self._found(attempt, (phase, approach), lambda: self._motions.reversed(phase, approach.down, scene))

    def _found(self, attempt: Attempt, key: tuple[object, ...], find: Callable[[], Motion]) -> Motion:
        """Return what `find` returned when this motion of the attempt was asked for first.

        Raises:
            ExecutorError: as it was raised then.
        """
        if key not in attempt.ways:
            try:
                attempt.ways[key] = find()
            except BudgetSpentError:
                raise
            except ExecutorError as error:
                attempt.ways[key] = error
        found = attempt.ways[key]
        if isinstance(found, ExecutorError):
            raise found
        return found

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
        return plan_placement(cloud, at, yaw, grasp, self.workspace, config.scene.table_z, config.placement)

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


def _with_offset(action: PickPlaceAction, grasp: Grasp) -> PlanarPose:
    """Return where the grasp's middle goes when everything moves as the pick pose is carried onto the place pose."""
    x, y = float(grasp.centroid[0]), float(grasp.centroid[1])
    return action.place @ action.pick.inverse() @ PlanarPose(x, y, action.pick.yaw)
