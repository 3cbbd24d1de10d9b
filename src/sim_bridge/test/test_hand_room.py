"""Room for the hand beside and above things, and what an arm refuses, at their limits."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest

from cliport_core import PlanarPose, Pose, WorkspaceSpec
from sim_bridge.control.arm_reflex import ArmControllerConfig, JointCommand, at_rest, reflex_fault
from sim_bridge.control.trajectory_spline import TrajectorySpline, as_knot
from sim_bridge.objects import cuboid
from sim_bridge.task_mechanics.clearance import FingerClearance, palm_is_free

SPEC = WorkspaceSpec(x_min=0.0, x_max=0.4, y_min=0.0, y_max=0.4)
HERE = PlanarPose(0.2, 0.2, 0.0)


class Ground:
    """A world of a thing, 4 cm wide and 2 cm high, and of a bar beside it."""

    def __init__(self, bar: tuple[float, float, float], height: float) -> None:
        self.config = SimpleNamespace(workspace=SPEC)
        thing, other = cuboid("thing", (0.04, 0.04, 0.02), 0.1), cuboid("bar", (0.02, 0.02, height), 0.1)
        shapes = (thing, other, SimpleNamespace(mesh=thing.mesh, collision=None))
        self.objects = [SimpleNamespace(mesh=shape.mesh, shape=shape) for shape in shapes]
        self._at = {
            id(self.objects[0]): Pose.from_xyz_rpy((0.2, 0.2, 0.01), (0.0, 0.0, 0.0)),
            id(self.objects[1]): Pose.from_xyz_rpy((bar[0], bar[1], height / 2), (0.0, 0.0, bar[2])),
            id(self.objects[2]): Pose.from_xyz_rpy((0.2, 0.24, 0.01), (0.0, 0.0, 0.0)),
        }

    def object_pose(self, thing: object) -> Pose:
        return self._at[id(thing)]


@pytest.mark.parametrize(
    ("bar", "yaw", "taken"),
    [
        ((0.3, 0.3, 0.0), 0.0, 0.0),
        ((0.2305, 0.2, 0.0), 0.0, 0.40),  # 20 mm of 24 along and 20 mm of 24 mm across, of one finger of two
        ((0.2305, 0.2, 0.0), math.pi / 2, 0.0),
        ((0.2, 0.1695, 0.0), math.pi / 2, 0.40),
        ((0.2 + 0.02 + 0.021 + 0.012, 0.2, 0.0), 0.0, 0.0),  # beyond the finger, which is 21 mm thick with its room
        ((0.23, 0.2 + 0.012 + 0.011, 0.0), 0.0, 0.0),  # beside it: it is 24 mm wide
        ((0.0, 0.0, 0.0), 0.0, 0.0),
    ],
)
def test_the_share_of_the_fingers_ground_that_is_taken(bar, yaw: float, taken: float) -> None:
    world = Ground(bar, 0.05)
    thing = world.objects[0]
    found = FingerClearance(world, thing, 0.01).blocked(PlanarPose(0.2, 0.2, yaw), 0.04)  # type: ignore[arg-type]
    assert found == pytest.approx(taken, abs=0.045)
    low = FingerClearance(world, thing, 0.051).blocked(PlanarPose(0.2, 0.2, yaw), 0.04)  # type: ignore[arg-type]
    assert low == 0.0, "what is lower than the level is not in the way"


@pytest.mark.parametrize(
    ("bar", "height", "free"),
    [
        ((0.28, 0.2, 0.0), 0.046, True),
        ((0.28, 0.2, 0.0), 0.048, False),  # as low as the palm comes over flat things: 47 mm
        ((0.2 + 0.108 + 0.009, 0.2, 0.0), 0.1, False),
        ((0.2 + 0.108 + 0.011, 0.2, 0.0), 0.1, True),
        ((0.2, 0.2 + 0.037 + 0.009, 0.0), 0.1, False),
        ((0.2, 0.2 + 0.037 + 0.011, 0.0), 0.1, True),
        ((0.2 - 0.108 - 0.009, 0.2 - 0.03, 0.0), 0.1, False),
    ],
)
def test_the_palm_is_free_where_nothing_high_is_below_it(bar, height: float, free: bool) -> None:
    """It is 20.6 cm x 6.4 cm, with half a centimetre around it."""
    world = Ground(bar, height)
    assert palm_is_free(world, world.objects[0], HERE) is free  # type: ignore[arg-type]


CONFIG = ArmControllerConfig()
READY = np.array([0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785])


def objection(*points: tuple[float, float, float], at: float = 0.0, told: float = 0.0) -> str | None:
    """Return what an arm at rest says to (time, position, velocity) of its first joint.

    at: where the joint is; told: the speed that it was told last.
    """
    knots = [as_knot(t, READY + np.eye(7)[0] * q, np.eye(7)[0] * v) for t, q, v in points]
    state = SimpleNamespace(positions=READY + np.eye(7)[0] * at, velocities=np.zeros(7))
    rest = at_rest(READY)
    command = JointCommand(rest.positions, np.eye(7)[0] * told, rest.accelerations)
    return reflex_fault(TrajectorySpline(knots), points[0][0], state, command, CONFIG)


@pytest.mark.parametrize(
    ("points", "at", "told", "words"),
    [
        ([(0, 0, 0), (1, 0.2, 0)], 0.0, 0.0, None),
        ([(0, 0, 0), (1, 0.2, 0)], 0.019, 0.0, None),
        ([(0, 0, 0), (1, 0.2, 0)], -0.021, 0.0, "the first point is 0.021 rad from panda_joint1 (limit 0.02)"),
        ([(0, 0, 0.09), (1, 0.2, 0)], 0.0, 0.0, None),
        ([(0, 0, 0.11), (1, 0.2, 0)], 0.0, 0.0, "the start jumps by 0.11 rad/s at panda_joint1 (limit 0.1)"),
        ([(0, 0, 0.11), (1, 0.2, 0)], 0.0, 0.05, None),
        ([(0, 0, 0), (1, 0.2, 0.09)], 0.0, 0.0, None),
        ([(0, 0, 0), (1, 0.2, 0.11)], 0.0, 0.0, "the speed jumps by 0.11 rad/s at panda_joint1 (limit 0.1)"),
        ([(0, 2.8972, 0), (1, 2.5, 0)], 2.8972, 0.0, None),
        ([(0, 2.89, 0), (1, 2.9, 0)], 2.89, 0.0, "a position is 0.003 rad beyond the upper limit of panda_joint1"),
        ([(0, -2.89, 0), (1, -2.9, 0)], -2.89, 0.0, "a position is 0.003 rad beyond the lower limit of panda_joint1"),
        ([(0, 0, 0), (1, 1.46, 0)], 0.0, 0.0, None),  # 1.5 x 1.46 rad/s in the middle; 2.175 are allowed
        ([(0, 0, 0), (1, 1.47, 0)], 0.0, 0.0, "the speed is 1.01 times the limit of panda_joint1"),
    ],
)
def test_what_an_arm_refuses_to_follow(points, at: float, told: float, words: str | None) -> None:
    assert objection(*points, at=at, told=told) == words
