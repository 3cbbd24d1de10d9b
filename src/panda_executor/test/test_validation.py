"""No fault passes the last look."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from panda_executor.errors import TrajectoryError
from panda_executor.ik import hand_down_pose
from panda_executor.model import PandaModel
from panda_executor.obstacle_grid import ObstacleGrid
from panda_executor.phase import Phase
from panda_executor.scene import Scene
from panda_executor.timing import time_path
from panda_executor.trajectory import JointTrajectory
from panda_executor.transfer import TransferPlanner
from panda_executor.validation import (
    MAX_JOINT_STEP,
    MAX_TCP_STEP,
    dense_positions,
    validate_trajectory,
)
from panda_model import load_preset

READY_POSITIONS = load_preset().ready
PANDA_LIMITS = load_preset().limits

ASIDE = READY_POSITIONS + np.array([0.4, 0.1, 0.0, 0.1, 0.0, 0.1, 0.3])


@pytest.fixture
def good(model: PandaModel) -> JointTrajectory:
    return time_path(np.stack([READY_POSITIONS, ASIDE]), PANDA_LIMITS.scaled(0.5, 0.5, 0.5), model, 1.0)


def refuse(trajectory: JointTrajectory, scene: Scene, words: str) -> None:
    with pytest.raises(TrajectoryError, match=words) as caught:
        validate_trajectory(trajectory, PANDA_LIMITS, scene)
    assert "\n" not in str(caught.value)


def test_a_good_one_passes(good: JointTrajectory, free_scene: Scene) -> None:
    validate_trajectory(good, PANDA_LIMITS, free_scene)


@pytest.mark.parametrize("name", ["times", "positions", "velocities", "accelerations"])
@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_numbers_that_are_not_finite(good: JointTrajectory, free_scene: Scene, name: str, value: float) -> None:
    array = getattr(good, name).copy()
    array[len(array) // 2] = value
    refuse(replace(good, **{name: array}), free_scene, f"{name} are not all finite")


@pytest.mark.parametrize("shift", [0.0, -0.01])
def test_times_that_do_not_increase(good: JointTrajectory, free_scene: Scene, shift: float) -> None:
    times = good.times.copy()
    times[5] = times[4] + shift
    refuse(replace(good, times=times), free_scene, "strictly increase")
    refuse(replace(good, times=good.times - 0.1), free_scene, "strictly increase")


@pytest.mark.parametrize(("row", "name"), [(0, "first"), (-1, "last")])
def test_ends_that_move(good: JointTrajectory, free_scene: Scene, row: int, name: str) -> None:
    velocities = good.velocities.copy()
    velocities[row, 2] = 0.01
    refuse(replace(good, velocities=velocities), free_scene, f"{name} velocity is not zero")


@pytest.mark.parametrize("joint", range(7))
def test_positions_beyond_a_joint_limit(model: PandaModel, free_scene: Scene, joint: int) -> None:
    beyond = READY_POSITIONS.copy()
    beyond[joint] = PANDA_LIMITS.upper[joint] + 0.05
    motion = time_path(np.stack([READY_POSITIONS, beyond]), PANDA_LIMITS.scaled(0.5, 0.5, 0.5), model, 1.0)
    refuse(motion, free_scene, rf"panda_joint{joint + 1} would pass its position limit by 0\.050 rad")


def test_only_the_last_point_beyond_a_joint_limit(good: JointTrajectory, free_scene: Scene) -> None:
    positions = good.positions.copy()
    positions[:, 6] = PANDA_LIMITS.upper[6] - 0.5
    positions[-1, 6] = PANDA_LIMITS.upper[6] + 0.02  # three quarters of the way there it is within
    refuse(replace(good, positions=positions), free_scene, r"panda_joint7 would pass its position limit by 0\.020 rad")


def test_motions_that_are_too_fast(good: JointTrajectory, free_scene: Scene) -> None:
    def faster(factor: float) -> JointTrajectory:
        return replace(
            good,
            times=good.times / factor,
            velocities=good.velocities * factor,
            accelerations=good.accelerations * factor**2,
        )

    refuse(faster(20.0), free_scene, "times its velocity limit")
    for name in ("velocity", "acceleration", "jerk"):
        tight = replace(PANDA_LIMITS, **{name: getattr(PANDA_LIMITS, name) * 0.01})
        with pytest.raises(TrajectoryError, match=rf"panda_joint\d would reach .* times its {name} limit"):
            validate_trajectory(good, tight, free_scene)


def test_a_jump_between_points_is_a_limit_broken(good: JointTrajectory, free_scene: Scene) -> None:
    positions = good.positions.copy()
    positions[10:] += 0.2
    refuse(replace(good, positions=positions), free_scene, "times its (velocity|acceleration|jerk) limit")


def test_limits_are_checked_at_the_controllers_rate(good: JointTrajectory, free_scene: Scene) -> None:
    """Two points only: the acceleration between them is highest at 0.21 of the way, where few samples would not be."""
    still = np.zeros((2, 7))
    ends = good.positions[[0, -1]]
    motion = replace(good, times=good.times[[0, -1]], positions=ends, velocities=still, accelerations=still)
    peak = np.abs(motion.sample(np.arange(0.0, motion.duration, 1e-3))[2]).max(axis=0)
    refusing, passing = (replace(PANDA_LIMITS, acceleration=np.maximum(peak, 1e-6) / share) for share in (1.03, 1.01))
    with pytest.raises(TrajectoryError, match="times its acceleration limit"):
        validate_trajectory(motion, refusing, free_scene)
    validate_trajectory(motion, passing, free_scene)


def test_a_way_through_the_table(planner: TransferPlanner, model: PandaModel, free_scene: Scene) -> None:
    below, _ = planner.ik.refine(hand_down_pose(0.5, 0.0, -0.03, 0.0), READY_POSITIONS)
    motion = time_path(np.stack([READY_POSITIONS, below]), PANDA_LIMITS.scaled(0.5, 0.5, 0.5), model, 1.0)
    refuse(motion, free_scene, "on the way .*table")


def test_a_way_through_an_object(planner: TransferPlanner, model: PandaModel, free_scene: Scene, workspace) -> None:
    ends = [planner.ik.solve_all(hand_down_pose(0.5, y, 0.06, 0.0), READY_POSITIONS)[0].positions for y in (-0.2, 0.2)]
    motion = time_path(np.stack(ends), PANDA_LIMITS.scaled(0.5, 0.5, 0.5), model, 1.0)
    validate_trajectory(motion, PANDA_LIMITS, free_scene)
    post = np.repeat([[0.5, 0.0, 0.2]], 5, axis=0).astype(np.float32)  # one column, 5 mm wide
    refuse(motion, free_scene.with_grid(ObstacleGrid.from_cloud(post, workspace, 0.012)), "(hand|arm) would touch")


def test_a_way_that_bends_is_no_approach(planner: TransferPlanner, model: PandaModel, free_scene: Scene) -> None:
    """In joint space between two poses over each other: the tcp bulges out beside the line between them."""
    start = planner.ik.solve_all(hand_down_pose(0.5, 0.1, 0.2, 0.0), READY_POSITIONS)[0].positions
    low = planner.ik.solve_near(hand_down_pose(0.5, 0.1, 0.02, 0.0), start, 1.5)
    assert low is not None
    bent = time_path(np.stack([start, low]), planner.motions.limits, model, 1.0)
    validate_trajectory(bent, PANDA_LIMITS, free_scene)
    with pytest.raises(TrajectoryError, match=r"the hand would be \d+\.\d mm off its straight way \(at most 5 mm"):
        validate_trajectory(bent, PANDA_LIMITS, free_scene, straightness=0.005)
    straight = planner.motions.straight(Phase.DESCEND, start, hand_down_pose(0.5, 0.1, 0.02, 0.0), free_scene)
    assert straight is not None and straight.straightness == 0.005
    assert planner.motions.reversed(Phase.RAISE, straight, free_scene).straightness == 0.005
    with pytest.raises(TrajectoryError, match="off its straight way"):
        planner.motions.among(replace(straight, trajectory=bent), free_scene.grid)


@pytest.mark.parametrize(("beyond", "valid"), [(-1e-3, True), (5e-7, True), (1e-3, False), (0.5, False)])
def test_a_joint_beyond_its_limit_is_not_valid(free_scene: Scene, beyond: float, valid: bool) -> None:
    positions = READY_POSITIONS.copy()
    positions[6] = PANDA_LIMITS.upper[6] + beyond  # the wrist turns: nothing is touched
    assert free_scene.is_valid(positions) == valid


def test_only_the_end_touches_the_table(planner: TransferPlanner, model: PandaModel, free_scene: Scene) -> None:
    guess = READY_POSITIONS
    for z in np.arange(0.05, -0.05, -0.001):
        guess, _ = planner.ik.refine(hand_down_pose(0.5, 0.0, float(z), 0.0), guess)
        if not free_scene.is_valid(guess):
            break
    motion = time_path(np.stack([READY_POSITIONS, guess]), PANDA_LIMITS.scaled(0.5, 0.5, 0.5), model, 1.0)
    way = dense_positions(motion.positions, free_scene)
    assert [free_scene.is_valid(positions) for positions in way] == [True] * (len(way) - 1) + [False]
    refuse(motion, free_scene, "on the way .*table")


def test_dense_positions_are_dense_and_keep_the_ends(free_scene: Scene, model: PandaModel) -> None:
    rough = np.stack([READY_POSITIONS, ASIDE, READY_POSITIONS + 0.3, READY_POSITIONS + 0.3])
    dense = dense_positions(rough, free_scene)
    tcp = np.array([model.tcp_arrays(q)[1] for q in dense])
    assert np.abs(np.diff(dense, axis=0)).max() <= MAX_JOINT_STEP * 1.001
    assert np.linalg.norm(np.diff(tcp, axis=0), axis=1).max() <= MAX_TCP_STEP * 1.05
    np.testing.assert_allclose(dense[[0, -1]], rough[[0, -1]])
