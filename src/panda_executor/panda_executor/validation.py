"""The last look at a trajectory before it is sent: nothing moves that did not pass here."""

from __future__ import annotations

import numpy as np

from panda_executor.errors import TrajectoryError
from panda_executor.model import PandaModel
from panda_executor.scene import Scene
from panda_executor.trajectory import JointTrajectory
from panda_model.limits import FloatArray, JointLimits

MAX_JOINT_STEP = 0.02  # between two configurations that are checked [rad]
MAX_TCP_STEP = 0.01  # [m]
CONTROL_PERIOD = 0.001  # of the arm's controller, which interpolates between the points [s]
_THINNED = 10  # control periods between two configurations whose distance is measured
_LINE_PERIOD = 0.02  # between two looks at the line of a straight motion [s]
_TOLERANCE = 1.02  # on velocity, acceleration and jerk: rounding of the interpolation


def validate_trajectory(
    trajectory: JointTrajectory, limits: JointLimits, scene: Scene, straightness: float | None = None
) -> None:
    """Check form, limits, straightness and collisions of what the controller will do with a trajectory.

    Args:
        limits: position, velocity, acceleration and jerk that must hold between the points, too.
        scene: the hand as it is during this motion, and what it must not touch.
        straightness: how far the tcp may be off the line from its start to its end [m]; None: there is no line.

    Raises:
        TrajectoryError: names the first thing that is wrong.
    """
    _check_form(trajectory)
    position, velocity, acceleration, jerk = trajectory.sample(_controller_times(trajectory.times))
    _check_limits(trajectory, limits, position, velocity, acceleration, jerk)
    if straightness is not None:
        _check_straight(trajectory, scene.model, straightness)
    thinned = np.concatenate([position[:-1:_THINNED], position[-1:]])
    _check_collisions(scene, dense_positions(thinned, scene))


def _controller_times(times: FloatArray) -> FloatArray:
    """Return the times [s] at which the controller interpolates a trajectory's `times` (N,), and those themselves."""
    return np.unique(np.concatenate([times, np.arange(times[0], times[-1], CONTROL_PERIOD)]))


def _check_straight(trajectory: JointTrajectory, model: PandaModel, most: float) -> None:
    """Check that the tcp stays on the line from its start to its end, but for `most` [m]. Raises TrajectoryError."""
    times = np.append(np.arange(trajectory.times[0], trajectory.times[-1], _LINE_PERIOD), trajectory.times[-1])
    tcp = np.array([model.tcp_arrays(positions)[1] for positions in trajectory.sample(times)[0]])
    along = tcp[-1] - tcp[0]
    length = max(float(np.linalg.norm(along)), 1e-9)
    share = np.clip((tcp - tcp[0]) @ along / length**2, 0.0, 1.0)
    off = float(np.linalg.norm(tcp - tcp[0] - share[:, None] * along, axis=1).max())
    if off > most:
        raise TrajectoryError(
            f"the hand would be {1e3 * off:.1f} mm off its straight way (at most {1e3 * most:g} mm, straightness)"
        )


def _check_form(trajectory: JointTrajectory) -> None:
    for name in ("times", "positions", "velocities", "accelerations"):
        if not np.all(np.isfinite(getattr(trajectory, name))):
            raise TrajectoryError(f"the trajectory's {name} are not all finite")
    if trajectory.times[0] < 0.0 or not np.all(np.diff(trajectory.times) > 0.0):
        raise TrajectoryError("the trajectory's times do not strictly increase from zero")
    for name, row in (("first", 0), ("last", -1)):
        if np.any(trajectory.velocities[row] != 0.0):
            raise TrajectoryError(f"the trajectory's {name} velocity is not zero")


def _check_limits(
    trajectory: JointTrajectory,
    limits: JointLimits,
    position: FloatArray,
    velocity: FloatArray,
    acceleration: FloatArray,
    jerk: FloatArray,
) -> None:
    if not limits.contains(position, 1e-6):
        excess = np.maximum(position - limits.upper, limits.lower - position).max(axis=0)
        joint = int(np.argmax(excess))
        raise TrajectoryError(
            f"{trajectory.joint_names[joint]} would pass its position limit by {excess[joint]:.3f} rad"
        )
    for name, ratios in (
        ("velocity", limits.velocity_ratio(position, velocity)),
        ("acceleration", np.abs(acceleration) / limits.acceleration),
        ("jerk", np.abs(jerk) / limits.jerk),
    ):
        ratio = ratios.max(axis=0)
        joint = int(np.argmax(ratio))
        if ratio[joint] > _TOLERANCE:
            raise TrajectoryError(
                f"{trajectory.joint_names[joint]} would reach {ratio[joint]:.2f} times its {name} limit"
            )


def dense_positions(positions: FloatArray, scene: Scene) -> FloatArray:
    """Return configurations (M, 7) along (N, 7) no further apart than 0.02 rad in any joint and 1 cm at the tcp."""
    tcp = np.array([scene.model.tcp_arrays(row)[1] for row in positions])
    joint_steps = np.abs(np.diff(positions, axis=0)).max(axis=1) / MAX_JOINT_STEP
    tcp_steps = np.linalg.norm(np.diff(tcp, axis=0), axis=1) / MAX_TCP_STEP
    travelled = np.concatenate([[0.0], np.cumsum(np.maximum(joint_steps, tcp_steps))])
    count = int(np.ceil(travelled[-1])) + 1
    wanted = np.linspace(0.0, travelled[-1], max(count, 2))
    dense = [np.interp(wanted, travelled, positions[:, joint]) for joint in range(positions.shape[1])]
    return np.stack(dense, axis=1)


def _check_collisions(scene: Scene, configurations: FloatArray) -> None:
    for positions in configurations:
        if not scene.is_valid(positions):
            raise TrajectoryError(f"on the way {scene.problem(positions)}")
