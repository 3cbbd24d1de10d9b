"""25 plans of an FR3 at its full scaling: within what the arm allows at each position, and its torques."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
import yaml
from fake_ports import FakeArm, FakeGripper
from synthetic_clouds import CAMERA, Cube, cloud_of

from cliport_core.action import ActionGoal, PickPlaceAction
from cliport_core.outcome import Outcome
from cliport_core.pose import PlanarPose
from cliport_core.workspace import WorkspaceSpec
from panda_executor.config import ExecutorConfig, SearchConfig
from panda_executor.model import PandaModel
from panda_executor.runner import PickPlaceRunner
from panda_executor.torques import torque_shares, torques_of
from panda_executor.trajectory import JointTrajectory
from panda_executor.transfer import TransferPlanner
from panda_model import load_preset

PLANS = 25
HARDWARE = Path(__file__).resolve().parents[2] / "cliport_bringup/config/policy.yaml"
FR3 = load_preset("fr3")


def test_gravity_alone_is_what_holds_the_arm_at_rest() -> None:
    model = PandaModel(FR3)
    arm = FakeArm()
    runner = PickPlaceRunner(model, full_speed(model), arm, FakeGripper())
    trajectory = next(iter(motions(runner, arm, 0)))
    _, held = torques_of(model, trajectory, gravity=True)
    expected = pin.computeGeneralizedGravity(model.model, model.data, trajectory.start)
    np.testing.assert_allclose(held[0], expected, atol=1e-6)
    _, commanded = torques_of(model, trajectory)
    np.testing.assert_allclose(commanded[0], np.zeros(7), atol=1e-6)


@pytest.mark.soak
def test_plans_at_full_scaling_stay_within_the_arms_limits() -> None:
    model = PandaModel(FR3)
    speeds, torques = list[float](), list[float]()
    for trajectory in all_motions(full_speed(model)):
        times = np.linspace(0.0, trajectory.duration, max(int(trajectory.duration / 0.001), 2))
        positions, velocities, _, _ = trajectory.sample(times)
        speeds.append(float(FR3.limits.velocity_ratio(positions, velocities).max()))
        torques.append(torque_shares(model, trajectory)[0])
    assert len(speeds) >= 5 * PLANS
    assert max(speeds) <= 1.001 and max(torques) <= 1.0


@pytest.mark.soak
def test_plans_as_on_hardware_need_no_torque_that_jumps() -> None:
    model = PandaModel(FR3)
    settings = yaml.safe_load(HARDWARE.read_text())["/panda_executor"]["ros__parameters"]
    rates = [torque_shares(model, trajectory)[1] for trajectory in all_motions(planner_with(model, **settings))]
    assert len(rates) >= 5 * PLANS and max(rates) <= 1.0


def all_motions(planner: TransferPlanner) -> Iterator[JointTrajectory]:
    """Yield the trajectories of all plans."""
    for seed in range(PLANS):
        arm = FakeArm()
        yield from motions(PickPlaceRunner(planner.model, planner, arm, FakeGripper()), arm, seed)


def full_speed(model: PandaModel) -> TransferPlanner:
    """Return a planner that goes as fast as the arm's limits allow."""
    return planner_with(model, velocity_scaling=1.0, acceleration_scaling=1.0, jerk_scaling=1.0, tcp_speed=3.0)


def planner_with(model: PandaModel, **timing: float) -> TransferPlanner:
    """Return a planner of these speeds, whose searches end by their number of checks."""
    config = ExecutorConfig.for_arm(FR3)
    search = SearchConfig(time_limit=60.0)
    slower = replace(config.timing, **timing)
    planner = TransferPlanner(model, replace(config, timing=slower, search=search, planning_time=60.0))
    planner.place_cameras(CAMERA)
    return planner


def motions(runner: PickPlaceRunner, arm: FakeArm, seed: int) -> list[JointTrajectory]:
    """Return the trajectories of one pick and place between places that the seed draws."""
    rng = np.random.default_rng(seed)
    pick, place = (
        PlanarPose(float(rng.uniform(0.35, 0.6)), float(side * rng.uniform(0.1, 0.3)), float(rng.uniform(-1.5, 1.5)))
        for side in (1.0, -1.0)
    )
    cloud = cloud_of([Cube(pick.x, pick.y, pick.yaw)], [])
    result = runner.run(ActionGoal(PickPlaceAction(pick, place)), cloud, WorkspaceSpec())
    assert result.outcome is Outcome.SUCCEEDED, result.message
    return arm.sent
