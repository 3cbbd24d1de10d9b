"""Planning one pick and place wholly before anything moves."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from cliport_perception.workspace import WorkspaceSpec
from panda_executor.config import ExecutorConfig
from panda_executor.errors import ExecutorError, InverseKinematicsError, PlanningError
from panda_executor.grasp import Grasp, plan_grasps
from panda_executor.hand_geometry import HandShape
from panda_executor.ik import HandDownIk, hand_down_pose, tilted
from panda_executor.limits import FloatArray
from panda_executor.model import PandaModel
from panda_executor.motions import Motion, MotionBuilder
from panda_executor.obstacle_grid import ObstacleGrid
from panda_executor.placement import Placement, plan_placement
from panda_executor.ports import ShouldStop
from panda_executor.request import Phase, PickPlaceRequest
from panda_executor.scene import Scene, add_surroundings

_OWN_MARGIN = 0.008  # around the grasped object's cells: its blurred edge in the cloud [m]
_RELEASE_STEP = 0.005
_RELEASE_RAISE = 0.05  # the object may be let go this much higher than wished [m]
_MAX_BRANCHES = 4  # of the inverse kinematics that are tried for one pose


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
        """In the order in which they are executed."""
        return (
            self.go_above, self.descend, self.raise_up, self.carry, self.lower, self.leave, self.retreat
        )  # fmt: skip


@dataclass(frozen=True, eq=False)
class _Approach:
    """A branch of the arm above a pose, and the straight motion down to it."""

    above: FloatArray
    down: Motion


class TransferPlanner:
    """Plans requests against a cloud. Adds the surroundings to the model that it is given, once.

    Args:
        clock: seconds, for the bounds on planning time.
    """

    def __init__(
        self,
        model: PandaModel,
        config: ExecutorConfig | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.config = config or ExecutorConfig()
        self.model = model
        self.clock = clock
        if not model.has_fixed_box("table"):
            add_surroundings(model, self.config.scene)
        self.ik = HandDownIk(model)
        self.motions = MotionBuilder(model, self.ik, self.config)
        self.ready = np.array(self.config.ready)

    def scene(self, grid: ObstacleGrid, hand: HandShape) -> Scene:
        """The surroundings with the given columns and hand."""
        return Scene(self.model, grid, hand, self.config.scene.table_z)

    def grid(self, cloud: npt.NDArray[np.float32], workspace: WorkspaceSpec, positions: FloatArray) -> ObstacleGrid:
        """Columns of the cloud, without those in which the hand itself is at `positions` (7,) [rad].

        The arm stands where it stands: a column there is the hand in its own camera's view, or something that
        it already touches and must be able to leave.
        """
        scene = self.config.scene
        floor = scene.table_z + scene.floor
        grid = ObstacleGrid.from_cloud(cloud, workspace, floor, scene.grid_cell)
        rotation, translation = self.model.tcp_arrays(positions)
        body = HandShape(margin=0.015).points @ rotation.T + translation
        return grid.without(body)

    def homeward(self, start: FloatArray, grid: ObstacleGrid, hand: HandShape) -> Motion:
        """From wherever the arm is, `start` (7,) [rad], to the ready pose.

        Raises:
            PlanningError: when there is no way.
        """
        return self.motions.travel(Phase.RETREAT, start, self.ready, self.scene(grid, hand))

    def plan(
        self,
        request: PickPlaceRequest,
        cloud: npt.NDArray[np.float32],
        workspace: WorkspaceSpec,
        start: FloatArray,
        on_phase: Callable[[Phase, float], None] = lambda phase, progress: None,
        should_stop: ShouldStop = lambda: False,
    ) -> PickPlacePlan:
        """Every motion of a pick and place from configuration `start` (7,) [rad].

        Args:
            cloud: (N, 3) float32 [m, base frame]; NaN allowed.

        Raises:
            GraspError: when the cloud gives no grasp.
            PlanningError: when no grasp, branch and path was found that is valid throughout.
        """
        deadline = self.clock() + self.config.planning_time
        cloud = relevant_points(cloud, workspace)
        grid = self.grid(cloud, workspace, start)
        on_phase(Phase.GRASP_PLANNING, 0.0)
        grasps = plan_grasps(cloud, request.pick, workspace, self.config.scene.table_z, self.config.grasp)
        on_phase(Phase.GRASP_PLANNING, 0.5)
        reason = ""
        for grasp in grasps:
            rest = cloud[~grasp.covers(cloud, _OWN_MARGIN)]
            rest_grid = self.grid(rest, workspace, start)
            for flip in self._flips(grasp, start):
                if self.clock() > deadline or should_stop():
                    raise PlanningError(reason or "planning took too long")
                try:
                    plan = self._plan_grasp(request, grasp, flip, rest, workspace, grid, rest_grid, start)
                    on_phase(Phase.GRASP_PLANNING, 1.0)
                    return plan
                except ExecutorError as error:
                    reason = reason or str(error)
        raise PlanningError(reason)

    def _flips(self, grasp: Grasp, start: FloatArray) -> list[float]:
        """0 and pi, the cheaper for the arm first: the gripper is the same when turned around."""
        x, y, _ = grasp.centroid
        costs = {}
        for flip in (0.0, math.pi):
            pose = hand_down_pose(x, y, grasp.tcp_z, grasp.yaw + flip)
            try:
                costs[flip] = self.ik.solve_all(pose, start)[0].cost
            except InverseKinematicsError:
                costs[flip] = math.inf
        return sorted(costs, key=lambda flip: costs[flip])

    def _plan_grasp(
        self,
        request: PickPlaceRequest,
        grasp: Grasp,
        flip: float,
        cloud: npt.NDArray[np.float32],
        workspace: WorkspaceSpec,
        grid: ObstacleGrid,
        rest_grid: ObstacleGrid,
        start: FloatArray,
    ) -> PickPlacePlan:
        config = self.config
        turn = request.place.yaw - request.pick.yaw
        grasp, placement = self._lowest_release(request, grasp, grasp.yaw + flip + turn, cloud, workspace)
        held = grasp.held(flip)
        loaded = HandShape(grasp.width, held)
        placement = self._clear_placement(placement, rest_grid, loaded)
        above_z = max(grasp.tcp_z, placement.tcp_z) + config.approach_height
        pick_xy = (float(grasp.centroid[0]), float(grasp.centroid[1]))
        opened = self.scene(rest_grid, HandShape(grasp.opening))
        carried = self.scene(rest_grid, loaded)
        released = self.scene(rest_grid, HandShape(placement.opening))
        travelling = HandShape(margin=config.clearance)
        loaded_wide = HandShape(grasp.width, held, config.clearance)
        reason = "no approach to the object is free"
        for pick in self._approaches(Phase.DESCEND, pick_xy, grasp.tcp_z, above_z, grasp.yaw + flip, opened, start):
            try:
                go_above = self.motions.travel(Phase.GO_ABOVE_PICK, start, pick.above, self.scene(grid, travelling))
                raise_up = self.motions.reversed(Phase.RAISE, pick.down, carried)
            except ExecutorError as error:
                reason = str(error)
                continue
            for place in self._approaches(
                Phase.LOWER, (placement.x, placement.y), placement.tcp_z, above_z,
                placement.yaw, carried, pick.above,
            ):  # fmt: skip
                try:
                    carry = self.motions.travel(
                        Phase.CARRY, pick.above, place.above, self.scene(rest_grid, loaded_wide)
                    )
                    leave = self.motions.reversed(Phase.RETREAT, place.down, released)
                    retreat = self.motions.travel(
                        Phase.RETREAT, place.above, self.ready, self.scene(rest_grid, travelling)
                    )
                except ExecutorError as error:
                    reason = str(error)
                    continue
                return PickPlacePlan(grasp, placement, go_above, pick.down, raise_up, carry, place.down, leave, retreat)
            reason = reason if reason != "no approach to the object is free" else "no way down at the place"
        raise PlanningError(reason)

    def _lowest_release(
        self,
        request: PickPlaceRequest,
        grasp: Grasp,
        yaw: float,
        cloud: npt.NDArray[np.float32],
        workspace: WorkspaceSpec,
    ) -> tuple[Grasp, Placement]:
        """Grasp and placement; where the fingers find no room at the place, they hold the object nearer to its top."""
        config = self.config
        place = request.place, yaw
        placement = plan_placement(cloud, *place, grasp, workspace, config.scene.table_z, config.placement)
        if placement.fall > config.placement.worth and grasp.spare > 0.0:
            grasp = grasp.raised(placement.fall)
            placement = plan_placement(cloud, *place, grasp, workspace, config.scene.table_z, config.placement)
        return grasp, placement

    def _clear_placement(self, placement: Placement, grid: ObstacleGrid, loaded: HandShape) -> Placement:
        """The placement, raised until hand, load and opened fingers are out of the columns.

        The hand comes straight down on columns: if its lowest pose is free, so is the way to it.
        """
        scenes = [self.scene(grid, loaded), self.scene(grid, HandShape(placement.opening))]
        for step in range(int(_RELEASE_RAISE / _RELEASE_STEP) + 1):
            z = placement.tcp_z + step * _RELEASE_STEP
            pose = hand_down_pose(placement.x, placement.y, z, placement.yaw)
            if all(scene.hand_is_clear(pose.rotation, pose.translation) for scene in scenes):
                return replace(placement, tcp_z=z)
        raise PlanningError(
            f"no room for hand and object at the place ({placement.x:.3f}, {placement.y:.3f}) m, "
            f"even {_RELEASE_RAISE * 100:.0f} cm higher"
        )

    def _approaches(
        self,
        phase: Phase,
        xy: tuple[float, float],
        z: float,
        above_z: float,
        yaw: float,
        scene: Scene,
        reference: FloatArray,
    ) -> Iterator[_Approach]:
        """Branches above a pose from which a straight motion leads down to it; upright ones first.

        Close to its base the arm cannot fold enough to keep the hand upright at every height: there it leans
        outwards above the object and rights itself on the way down.
        """
        goal = hand_down_pose(*xy, z, yaw)
        for lean in self.config.lean:
            above_pose = tilted(hand_down_pose(*xy, above_z, yaw), lean)
            try:
                solutions = self.ik.solve_all(above_pose, reference)
            except InverseKinematicsError:
                continue
            found = False
            for solution in solutions[:_MAX_BRANCHES]:
                if not scene.is_valid(solution.positions):
                    continue
                down = self.motions.straight(phase, solution.positions, goal, scene)
                if down is not None:
                    found = True
                    yield _Approach(solution.positions, down)
            if found:
                return


def relevant_points(cloud: npt.NDArray[np.float32], workspace: WorkspaceSpec) -> npt.NDArray[np.float32]:
    """The points (N, 3) over and around the workspace; NaN are dropped."""
    border = 0.12
    near = (cloud[:, 0] > workspace.x_min - border) & (cloud[:, 0] < workspace.x_max + border)
    near &= (cloud[:, 1] > workspace.y_min - border) & (cloud[:, 1] < workspace.y_max + border)
    near &= (cloud[:, 2] > workspace.z_min - 0.02) & (cloud[:, 2] <= workspace.z_max)
    return cloud[near]
