"""Single motions: what a builder returns was checked, and what it cannot make it refuses in its own words."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from cliport_core.workspace import WorkspaceSpec
from panda_executor import motions
from panda_executor.budget import Budget
from panda_executor.errors import BudgetSpentError, PlanningError, TrajectoryError
from panda_executor.ik import hand_down_pose
from panda_executor.obstacle_grid import ObstacleGrid
from panda_executor.phase import Phase
from panda_executor.scene import Scene
from panda_executor.transfer import TransferPlanner
from panda_model import load_preset

READY = load_preset().ready


def test_a_path_that_cannot_be_timed_is_no_plan(
    planner: TransferPlanner, free_scene: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It used to end as a failed execution, although nothing moved."""

    def fail(*_: Any) -> None:
        raise TrajectoryError("joint 3 would reach 1.10 times its jerk limit")

    monkeypatch.setattr(motions, "time_path", fail)
    with pytest.raises(PlanningError, match="the path found does not hold when checked again: joint 3"):
        planner.motions.travel(Phase.RETREAT, READY + 0.1, READY, free_scene)


def test_a_rest_is_checked_too(planner: TransferPlanner, free_scene: Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    checked: list[np.ndarray] = []
    validate = motions.validate_trajectory

    def note(trajectory: Any, *others: Any) -> None:
        checked.append(trajectory.positions)
        validate(trajectory, *others)

    monkeypatch.setattr(motions, "validate_trajectory", note)
    motion = planner.motions.travel(Phase.RETREAT, READY, READY, free_scene)
    assert len(checked) == 1
    np.testing.assert_array_equal(checked[0], motion.trajectory.positions)


def test_a_way_back_is_checked_with_the_other_hand(
    planner: TransferPlanner, free_scene: Scene, workspace: WorkspaceSpec
) -> None:
    start = planner.ik.solve_all(hand_down_pose(0.5, 0.1, 0.2, 0.0), READY)[0].positions
    motion = planner.motions.straight(Phase.DESCEND, start, hand_down_pose(0.5, 0.1, 0.02, 0.0), free_scene)
    assert motion is not None
    wall = np.stack(np.meshgrid([0.5], [0.1], np.linspace(0.05, 0.1, 20)), -1).reshape(-1, 3).astype(np.float32)
    walled = free_scene.with_grid(ObstacleGrid.from_cloud(wall, workspace, 0.012))
    with pytest.raises(TrajectoryError, match="would touch"):
        planner.motions.reversed(Phase.RAISE, motion, walled)


def test_no_motion_is_made_once_planning_is_to_end(planner: TransferPlanner, free_scene: Scene) -> None:
    """Thousands of pairs of ways down were joined in vain for a quarter of an hour: nothing in there looked."""
    start, stopped = READY + 0.1, planner.motions_within(Budget(should_stop=lambda: True))
    motion = planner.motions.travel(Phase.RETREAT, start, READY, free_scene)
    for make in (
        lambda: stopped.travel(Phase.RETREAT, start, READY, free_scene),
        lambda: stopped.straight(Phase.DESCEND, start, hand_down_pose(0.5, 0.1, 0.02, 0.0), free_scene),
        lambda: stopped.reversed(Phase.RAISE, motion, free_scene),
        lambda: stopped.among(motion, free_scene.grid),
    ):
        with pytest.raises(BudgetSpentError, match="planning was stopped"):
            make()


def test_stops_at_corners_keep_the_configured_period(
    planner: TransferPlanner, free_scene: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    periods: list[float] = []
    time_path = motions.time_path

    def note(*arguments: Any) -> Any:
        periods.append(arguments[4])
        return time_path(*arguments)

    monkeypatch.setattr(motions, "time_path", note)
    planner.motions._stopping(Phase.CARRY, np.stack([READY, READY + 0.1, READY]), free_scene)
    assert periods == [planner.config.timing.period] * 2


def test_a_corner_is_cut_by_a_quarter_and_by_fifteen_hundredths_at_most() -> None:
    three_quarters = 0.4 * (1.0 - 0.75**3)  # a quarter of what is left of the leg, three times
    for leg, cut in ((0.4, three_quarters), (2.0, 3 * 0.15)):
        corner = np.zeros((3, 7))
        corner[0, 0], corner[2, 1] = -leg, leg
        points = motions._rounded(corner)
        np.testing.assert_array_equal(points[[0, -1]], corner[[0, -1]])
        nearest = np.linalg.norm(points, axis=1).min()
        assert nearest < cut and np.linalg.norm(np.diff(points, axis=0), axis=1).max() <= 0.15 + 1e-9
        straight = points[(points[:, 1] == 0.0)][:, 0]
        assert straight.max() == pytest.approx(-cut), "up to there the way is the leg itself"
