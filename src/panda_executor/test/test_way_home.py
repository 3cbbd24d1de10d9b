"""The way home after a failure: among everything that the plan's cloud shows, but for what the arm touches."""

from __future__ import annotations

import numpy as np
import pytest
from fake_ports import FakeArm, FakeGripper
from synthetic_clouds import Bowl, Cube, bowl_points, cube_points, seen_cloud

from cliport_core.action import ActionGoal, PickPlaceAction
from cliport_core.outcome import Outcome
from cliport_core.pose import PlanarPose
from cliport_core.workspace import WorkspaceSpec
from panda_executor.hand_geometry import HandShape
from panda_executor.ik import hand_down_pose
from panda_executor.obstacle_grid import ObstacleGrid
from panda_executor.runner import PickPlaceRunner
from panda_executor.transfer import TransferPlanner
from panda_model import FloatArray, load_preset

READY = load_preset().ready
GOAL = ActionGoal(PickPlaceAction(PlanarPose(0.45, 0.1, 0.3), PlanarPose(0.5, -0.2, 0.3)))


def column_at_the_forearm(planner: TransferPlanner, positions: FloatArray, aside: float) -> np.ndarray:
    """Points (N, 3) at the height of the lowest sphere of the forearm, `aside` [m] from its middle."""
    planner.model.tcp_arrays(positions)
    cover = planner.model.reaching
    centres = cover.placed(planner.model.data)[cover.joints == 5]
    x, y, z = centres[int(np.argmin(centres[:, 2]))]
    steps = np.arange(-0.01, 0.01, 0.002)
    return np.stack(np.meshgrid(x + steps, y + aside + steps, [z]), -1).reshape(-1, 3).astype(np.float32)


def test_what_stands_beside_the_arm_stays_on_the_way_home(planner: TransferPlanner) -> None:
    """It was taken for the arm itself, which stood elsewhere when the cloud was taken."""
    arm, gripper = FakeArm(), FakeGripper(opening=0.0, object_width=0.0)
    cloud = seen_cloud(cube_points(Cube(0.45, 0.1, 0.3)), bowl_points(Bowl(0.5, -0.2)))
    runner = PickPlaceRunner(planner.model, planner, arm, gripper)
    seen_at: list[np.ndarray] = []
    make = planner.grid

    def grid(cloud: np.ndarray, workspace: WorkspaceSpec, positions: FloatArray) -> ObstacleGrid:
        seen_at.append(positions)
        return make(cloud, workspace, positions)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(planner, "grid", grid)
        assert runner.run(GOAL, cloud, WorkspaceSpec()).outcome is Outcome.GRASP_MISSED
        arm.positions = READY + 0.1
        assert runner.go_ready(cloud=cloud).outcome is Outcome.SUCCEEDED
    np.testing.assert_array_equal(seen_at, [READY, READY + 0.1])  # a person's request: the cloud is of now


def test_what_a_link_touches_it_may_leave_and_nothing_else(planner: TransferPlanner, workspace: WorkspaceSpec) -> None:
    low = planner.ik.solve_all(hand_down_pose(0.6, 0.0, 0.05, 0.0), READY)[0].positions
    touching, beside = column_at_the_forearm(planner, low, 0.0), column_at_the_forearm(planner, low, 0.15)
    grid = ObstacleGrid.from_cloud(np.concatenate([touching, beside]), workspace, 0.012)
    scene = planner.scene(grid, HandShape(planner.config.hand))
    assert "the arm would touch" in (scene.problem(low) or "")
    free = scene.escaping(low)
    assert free.problem(low) is None
    assert free.grid.hits(beside.mean(axis=0) - [0.0, 0.0, 0.01]), "what it does not touch vanished, too"
    assert not free.grid.hits(touching.mean(axis=0) - [0.0, 0.0, 0.01])


def test_columns_are_freed_three_centimetres_around_a_link_at_most(
    planner: TransferPlanner, workspace: WorkspaceSpec, monkeypatch: pytest.MonkeyPatch
) -> None:
    low = planner.ik.solve_all(hand_down_pose(0.6, 0.0, 0.05, 0.0), READY)[0].positions
    grid = ObstacleGrid.from_cloud(column_at_the_forearm(planner, low, 0.0), workspace, 0.012)
    scene = planner.scene(grid, HandShape(planner.config.hand))
    _, radii = scene._touching(planner.model.reaching.placed(planner.model.data)) or (None, np.zeros(0))
    freed: list[np.ndarray] = []
    monkeypatch.setattr(ObstacleGrid, "without_near", lambda g, centres, r: freed.append(r) or g)
    scene.escaping(low)  # nothing is freed, so it goes on to the last
    for spare, found in zip((0.01, 0.02, 0.03), freed, strict=True):
        np.testing.assert_allclose(found, radii + spare)
