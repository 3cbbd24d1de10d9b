"""A second look at a trajectory that the arm's controller was sent, apart from the executor's own check."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from panda_executor.model import PandaModel
from panda_executor.scene import SceneConfig, add_table, place_camera
from panda_model import load_preset
from sim_bridge.rendering.camera import CameraConfig

PANDA_LIMITS = load_preset().limits

ROUNDING = 1.05
JOINTS = load_preset().arm_joints


@lru_cache(maxsize=1)
def _model() -> PandaModel:
    model = PandaModel()
    add_table(model, SceneConfig())
    place_camera(model, SceneConfig(), CameraConfig().camera_in_base.translation)
    return model


def recheck_trajectory(sent: dict[str, Any]) -> None:
    """Limits of velocity, acceleration and jerk, and no contact with itself, table or post at 1 cm or 0.02 rad."""
    order = [sent["joint_names"].index(name) for name in JOINTS]
    times = np.array(sent["times"])
    positions, velocities, accelerations = (
        np.array(sent[name])[:, order] for name in ("positions", "velocities", "accelerations")
    )
    assert (np.diff(times) > 0).all()
    assert (np.abs(velocities) <= PANDA_LIMITS.velocity * ROUNDING).all()
    assert (np.abs(accelerations) <= PANDA_LIMITS.acceleration * ROUNDING).all()
    jerks = np.diff(accelerations, axis=0) / np.diff(times)[:, None]
    assert (np.abs(jerks) <= PANDA_LIMITS.jerk * ROUNDING).all()
    assert np.abs(velocities[[0, -1]]).max() < 1e-6
    spline = CubicHermiteSpline(times, positions, velocities)
    fine = spline(np.linspace(times[0], times[-1], max(2, int(200 * (times[-1] - times[0])))))
    last = None
    for configuration in fine:
        tcp = _model().tcp_pose(configuration).translation
        if last is not None and np.abs(configuration - last[0]).max() < 0.02 and np.linalg.norm(tcp - last[1]) < 0.01:
            continue
        last = (configuration, tcp)
        assert PANDA_LIMITS.contains(configuration, 1e-6)
        pair = _model().colliding_pair(configuration)
        assert pair is None, f"{pair} touch at {configuration}"
