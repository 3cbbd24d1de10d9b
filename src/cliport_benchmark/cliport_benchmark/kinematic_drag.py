"""Sweeps and folds without the arm, for fast data generation: what the fingers would push or hold is moved through
physics, faster than the arm does it and with fewer iterations of the solver."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

from cliport_core import PlanarPose, Pose
from sim_bridge.bullet import pybullet
from sim_bridge.objects import SceneObject
from sim_bridge.robot import HAND
from sim_bridge.sleeping import come_to_rest, wake
from sim_bridge.task_mechanics.object_at import object_at
from sim_bridge.world import SimWorld

# the closed fingers: along and across the motion, and a part of their height [m]
_HAND = (HAND.closed_depth, HAND.closed_width, 0.06)
_ABOVE_TABLE = 0.004  # height of the fingers' rounded tips [m]
_HAND_MASS = 10.0  # so large that nothing on the table stops it [kg]
_FINGER_FRICTION = 1.5
_LIFT = 0.02  # of what is held, as in the executor's fold [m]
_GRIP_FORCE = 50.0  # [N]
_SPEED = 0.5  # [m/s]
_ACCELERATION = 2.0  # less than friction's, so that nothing slides on ahead [m/s^2]
_SOLVER_ITERATIONS = 20


def sweep(world: SimWorld, pick: PlanarPose, place: PlanarPose) -> None:
    """The closed hand moves from pick to place, broadside to its motion, and is gone; then all comes to rest."""
    way = np.array([place.x - pick.x, place.y - pick.y, 0.0])
    length = float(np.linalg.norm(way))
    if length < 1e-6:
        return
    yaw = math.atan2(way[1], way[0])
    start = PlanarPose(pick.x, pick.y, yaw).as_pose(_ABOVE_TABLE + _HAND[2] / 2)
    with _cheap_physics(world):
        with _hand(world) as hand:
            for gone, speed in _progress(length, world.dt):
                at = Pose(start.rotation, start.translation + way * (gone / length))
                _put(world, hand, at, way * (speed / length))
                world.step()
        come_to_rest(world)


def fold(world: SimWorld, pick: PlanarPose, place: PlanarPose) -> None:
    """Lift the thing at pick a little, move it to place while it turns as the jaws do, and let go."""
    thing = object_at(world, pick.x, pick.y, movable=True)
    if thing is None:
        return
    held = world.object_pose(thing)
    wake(world, [thing])
    way = np.array([place.x - pick.x, place.y - pick.y, 0.0])
    turn = math.remainder(place.yaw - pick.yaw, math.tau)
    with _cheap_physics(world):
        with _grip(world, thing, held) as grip:
            for height, _ in _progress(_LIFT, world.dt):
                _pull(world, grip, _moved(held, np.array([0.0, 0.0, height]), 0.0))
                world.step()
            length = max(float(np.linalg.norm(way)), 1e-6)
            for gone, _ in _progress(length, world.dt):
                share = gone / length
                _pull(world, grip, _moved(held, way * share + (0.0, 0.0, _LIFT), turn * share))
                world.step()
        come_to_rest(world)


def _progress(length: float, dt: float) -> Iterator[tuple[float, float]]:
    """Return distance gone [m] and speed [m/s] step by step: from rest to rest with a bounded acceleration."""
    top = min(_SPEED, math.sqrt(length * _ACCELERATION))
    ramp, even = top / _ACCELERATION, length / top - top / _ACCELERATION
    for t in np.arange(0.0, 2 * ramp + even, dt):
        if t < ramp:
            yield 0.5 * _ACCELERATION * t * t, _ACCELERATION * t
        elif t < ramp + even:
            yield top * (t - ramp / 2), top
        else:
            left = 2 * ramp + even - t
            yield length - 0.5 * _ACCELERATION * left * left, _ACCELERATION * left
    yield length, 0.0


def _moved(pose: Pose, shift: np.ndarray, turn: float) -> Pose:  # type: ignore[type-arg]
    about_z = Pose.from_xyz_rpy((0.0, 0.0, 0.0), (0.0, 0.0, turn)).rotation
    return Pose(about_z @ pose.rotation, pose.translation + shift)


@contextmanager
def _hand(world: SimWorld) -> Iterator[int]:
    """Yield the body of a block that stands in place of the fingers."""
    shape = pybullet.createCollisionShape(
        pybullet.GEOM_BOX, halfExtents=[edge / 2 for edge in _HAND], physicsClientId=world.client
    )
    body = pybullet.createMultiBody(_HAND_MASS, shape, basePosition=[0.0, 0.0, 1.0], physicsClientId=world.client)
    pybullet.changeDynamics(body, -1, lateralFriction=_FINGER_FRICTION, physicsClientId=world.client)
    try:
        yield body
    finally:
        pybullet.removeBody(body, physicsClientId=world.client)


def _put(world: SimWorld, body: int, pose: Pose, velocity: np.ndarray) -> None:  # type: ignore[type-arg]
    pybullet.resetBasePositionAndOrientation(
        body, pose.translation.tolist(), pose.as_quaternion_xyzw().tolist(), physicsClientId=world.client
    )
    pybullet.resetBaseVelocity(body, velocity.tolist(), [0.0, 0.0, 0.0], physicsClientId=world.client)


@contextmanager
def _grip(world: SimWorld, thing: SceneObject, at: Pose) -> Iterator[int]:
    """Yield a constraint that holds a thing in place of the fingers: it stays where `_pull` says."""
    grip = pybullet.createConstraint(
        thing.body,
        -1,
        -1,
        -1,
        jointType=pybullet.JOINT_FIXED,
        jointAxis=[0, 0, 0],
        parentFramePosition=[0, 0, 0],
        childFramePosition=at.translation.tolist(),
        childFrameOrientation=at.as_quaternion_xyzw().tolist(),
        physicsClientId=world.client,
    )
    try:
        yield grip
    finally:
        pybullet.removeConstraint(grip, physicsClientId=world.client)


def _pull(world: SimWorld, grip: int, pose: Pose) -> None:
    pybullet.changeConstraint(
        grip,
        jointChildPivot=pose.translation.tolist(),
        jointChildFrameOrientation=pose.as_quaternion_xyzw().tolist(),
        maxForce=_GRIP_FORCE,
        physicsClientId=world.client,
    )


@contextmanager
def _cheap_physics(world: SimWorld) -> Iterator[None]:
    """Run physics with fewer iterations: where things end up differs no more than between two sweeps of the arm."""
    pybullet.setPhysicsEngineParameter(numSolverIterations=_SOLVER_ITERATIONS, physicsClientId=world.client)
    try:
        yield
    finally:
        pybullet.setPhysicsEngineParameter(
            numSolverIterations=world.config.solver_iterations, physicsClientId=world.client
        )
