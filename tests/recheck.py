"""A second look at a trajectory that the arm's controller was sent, apart from the executor's own check."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
from scipy.interpolate import BPoly

from panda_executor.model import PandaModel
from panda_executor.scene import Scene, SceneConfig, add_table, place_camera
from panda_executor.trajectory import JointTrajectory
from panda_model import load_preset
from sim_bridge.rendering.camera import CameraConfig

LIMITS = load_preset().limits
ROUNDING = 1.02
JOINTS = load_preset().arm_joints
PERIOD = 0.001  # of the controller [s]
STILL = (
    0.001  # a configuration no joint of which is farther from the last one checked is not checked for contacts [rad]
)


@lru_cache(maxsize=1)
def _model() -> PandaModel:
    model = PandaModel()
    add_table(model, SceneConfig())
    place_camera(model, SceneConfig(), CameraConfig().camera_in_base.translation)
    return model


def recheck_trajectory(sent: dict[str, Any]) -> None:
    """Check limits, and contacts with itself, table and post, of the quintics between the points at 1 kHz.

    sent: joint_names, times (N,) [s], positions, velocities and accelerations (N, 7) [rad, rad/s, rad/s^2] as lists.

    Raises:
        AssertionError: says which limit is passed, or which pair comes too close.
    """
    order = [sent["joint_names"].index(name) for name in JOINTS]
    times = np.array(sent["times"])
    positions, velocities, accelerations = (
        np.array(sent[name])[:, order] for name in ("positions", "velocities", "accelerations")
    )
    assert (np.diff(times) > 0).all(), "times do not increase"
    assert np.abs(velocities[[0, -1]]).max() < 1e-6, "it does not begin and end at rest"
    path = BPoly.from_derivatives(times, np.stack([positions, velocities, accelerations], axis=1))
    moments = np.unique(np.concatenate([times, np.arange(times[0], times[-1], PERIOD)]))
    fine = path(moments)
    assert LIMITS.contains(fine, 1e-6), "a position limit is passed"
    for order_, name, bound in ((1, "velocity", LIMITS.velocity), (2, "acceleration", LIMITS.acceleration)):
        _within(path(moments, order_), bound, name)
    inside = moments[:-1] + np.diff(moments) / 2.0  # the jerk jumps at the points
    _within(path(inside, 3), LIMITS.jerk, "jerk")
    last = fine[0] + np.inf
    for configuration in fine:
        if np.abs(configuration - last).max() > STILL:
            last = configuration
            pair = _model().colliding_pair(configuration)
            assert pair is None, f"{pair} touch at {configuration}"


def recheck_clearance(trajectory: JointTrajectory, scene: Scene) -> None:
    """Check at 1 kHz that nothing comes nearer to what was seen than the plan's margins.

    scene: the one that the motion was validated in, with its hand, load and margins.

    Raises:
        AssertionError: says what comes too close to what.
    """
    times = np.append(np.arange(trajectory.times[0], trajectory.times[-1], PERIOD), trajectory.times[-1])
    last = np.full(len(trajectory.start), np.inf)
    for configuration in trajectory.sample(times)[0]:
        if np.abs(configuration - last).max() > STILL:
            last = configuration
            problem = scene.problem(configuration)
            assert problem is None, f"{problem} at {configuration}"


def _within(values: np.ndarray, bound: np.ndarray, name: str) -> None:
    ratio = (np.abs(values) / bound).max()
    assert ratio <= ROUNDING, f"{ratio:.3f} times the limit of {name}"
