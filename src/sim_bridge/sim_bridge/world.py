"""The simulated world: a table, a Panda and objects in one PyBullet client."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from cliport_core import PlanarPose, Pose, WorkspaceSpec
from sim_bridge.bullet import pybullet
from sim_bridge.colors import Rgb, rgb
from sim_bridge.errors import PhysicsError, SimulationError
from sim_bridge.objects import SceneObject, Shape
from sim_bridge.panda import PandaArm

_STEEP_COSINE = 0.7  # an axis with a larger vertical part stands upright
_MAX_DISTANCE = 2.0  # of an object from the base, along each axis [m]
_TABLE_HALF = (2.0, 2.0, 0.25)  # half edges of the slab about the origin whose top is the table's [m]
_MAX_SPEED = 20.0  # of an object that did not fly off [m/s]


@dataclass(frozen=True)
class SimConfig:
    """Physics settings; the defaults are what data generation and evaluation use."""

    workspace: WorkspaceSpec = field(default_factory=WorkspaceSpec)
    rate_hz: int = 240
    solver_iterations: int = 100
    gravity: float = 9.8  # [m/s^2]
    table_friction: float = 1.0
    settled_speed: float = 5e-3  # an object slower than this rests [m/s]
    max_settle_s: float = 2.0
    max_layouts: int = 60  # scenes that are tried before one is given up

    def __post_init__(self) -> None:
        if self.rate_hz < 60 or self.solver_iterations < 1:
            raise SimulationError(
                f"physics needs rate_hz >= 60 and solver_iterations >= 1, "
                f"got {self.rate_hz} and {self.solver_iterations}"
            )


class SimWorld:
    """Owns one PyBullet client; the same calls give the same states, always.

    World frame = base frame: x forward, y left, z up, the table's top at z = 0. Simulated time
    runs on over resets, so that it can drive a clock.

    paints: RGB 0..255 of colours of the benchmark that look otherwise in the scenes to come, by name.
    """

    def __init__(self, config: SimConfig | None = None) -> None:
        self.config = config or SimConfig()
        self.client: int = pybullet.connect(pybullet.DIRECT)
        if self.client < 0:
            raise SimulationError("PyBullet gave no physics server; close other worlds of this process first")
        self._steps = 0
        self._objects: list[SceneObject] = []
        self.paints: dict[str, Rgb] = {}
        self.panda: PandaArm
        self.clear()

    @property
    def time(self) -> float:
        """Simulated time since the world was made [s]."""
        return self._steps / self.config.rate_hz

    @property
    def dt(self) -> float:
        """Length of a step [s]."""
        return 1.0 / self.config.rate_hz

    @property
    def objects(self) -> Sequence[SceneObject]:
        """Things on the table, in the order in which they were added."""
        return tuple(self._objects)

    def clear(self) -> None:
        """Make the world anew, empty and with the arm at home, so that nothing of the last scene can reach the next."""
        pybullet.resetSimulation(physicsClientId=self.client)
        pybullet.setGravity(0.0, 0.0, -self.config.gravity, physicsClientId=self.client)
        pybullet.setPhysicsEngineParameter(
            fixedTimeStep=self.dt,
            numSolverIterations=self.config.solver_iterations,
            deterministicOverlappingPairs=1,
            # a tenth of Bullet's: its contacts keep their normals, and old ones made turned things stick to a finger
            contactBreakingThreshold=0.002,
            physicsClientId=self.client,
        )
        self._objects = []
        # a plane would touch a small thing in one point at a time: it would spin there, and sink
        slab = pybullet.createCollisionShape(pybullet.GEOM_BOX, halfExtents=_TABLE_HALF, physicsClientId=self.client)
        table = pybullet.createMultiBody(0.0, slab, basePosition=[0, 0, -_TABLE_HALF[2]], physicsClientId=self.client)
        pybullet.changeDynamics(table, -1, lateralFriction=self.config.table_friction, physicsClientId=self.client)
        self.panda = PandaArm(self.client)

    def step(self) -> None:
        """Advance physics by one step."""
        pybullet.stepSimulation(physicsClientId=self.client)
        self._steps += 1

    def skip(self, seconds: float) -> None:
        """Let time go on without physics."""
        self._steps += round(seconds * self.config.rate_hz)

    def settle(self) -> bool:
        """Run physics until every object rests or `max_settle_s` passed; return True if they rest.

        Raises:
            PhysicsError: when an object left the scene or moves impossibly fast.
        """
        for i in range(round(self.config.max_settle_s * self.config.rate_hz)):
            if i >= 24 and self._at_rest():
                break
            self.step()
        self.check_intact()
        return self._at_rest()

    def check_intact(self) -> None:
        """Refuse a scene in which things flew off: physics that explodes must not become a score.

        Raises:
            PhysicsError: when an object left the scene or moves impossibly fast.
        """
        for thing in self._objects:
            if thing.fixed:
                continue
            at = self.object_pose(thing).translation
            linear, _ = pybullet.getBaseVelocity(thing.body, physicsClientId=self.client)
            speed = float(np.linalg.norm(linear))
            if not (np.isfinite(at).all() and np.abs(at).max() < _MAX_DISTANCE and speed < _MAX_SPEED):
                raise PhysicsError(f"the {thing.described} flew off to {np.round(at, 2).tolist()} m at {speed:.0f} m/s")

    def add(
        self, shape: Shape, pose: Pose, color: str = "", paint: Rgb | None = None, fixed: bool = False
    ) -> SceneObject:
        """Add a thing of that shape at that pose, at rest, and return it; a fixed one never moves.

        color: of the benchmark's; paint: 0..255, for what has a colour of its own; white when neither is given.
        What `paints` holds is painted so instead.

        Raises:
            UnknownNameError: when the benchmark has no such colour.
        """
        body: int = pybullet.createMultiBody(
            baseMass=0.0 if fixed else shape.mass,
            baseCollisionShapeIndex=shape.collision.create(self.client) if shape.collision else -1,
            basePosition=pose.translation.tolist(),
            baseOrientation=pose.as_quaternion_xyzw().tolist(),
            physicsClientId=self.client,
        )
        pybullet.changeDynamics(
            body,
            -1,
            lateralFriction=shape.friction,
            spinningFriction=0.002,
            rollingFriction=shape.rolling_friction,
            physicsClientId=self.client,
        )
        own = paint or self.paints.get(color) or (rgb(color) if color else (255, 255, 255))
        thing = SceneObject(shape, color, own, body, fixed)
        self._objects.append(thing)
        return thing

    def remove(self, thing: SceneObject) -> None:
        """Take a thing out of the world."""
        pybullet.removeBody(thing.body, physicsClientId=self.client)
        self._objects.remove(thing)

    def object_pose(self, thing: SceneObject) -> Pose:
        """Return the pose of the object's centre in the base frame."""
        position, quaternion = pybullet.getBasePositionAndOrientation(thing.body, physicsClientId=self.client)
        return Pose.from_quaternion_xyzw(np.asarray(quaternion), np.asarray(position))

    def object_xy(self, thing: SceneObject) -> npt.NDArray[np.float64]:
        """Return the centre of the object, (2,) [m]."""
        return self.object_pose(thing).translation[:2]

    def object_yaw(self, thing: SceneObject) -> float:
        """Return the angle of the object's x axis about z [rad]; where that axis
        stands upright, that of its y axis less a quarter."""
        rotation = self.object_pose(thing).rotation
        if abs(rotation[2, 0]) < _STEEP_COSINE:
            return math.atan2(rotation[1, 0], rotation[0, 0])
        return math.atan2(rotation[1, 1], rotation[0, 1]) - math.pi / 2

    def planar_pose(self, thing: SceneObject) -> PlanarPose:
        """Return the object's place on the table and its yaw."""
        x, y = self.object_xy(thing)
        return PlanarPose(float(x), float(y), self.object_yaw(thing))

    def is_still(self, thing: SceneObject) -> bool:
        """Return True if an object moves slower than `settled_speed`."""
        linear, _ = pybullet.getBaseVelocity(thing.body, physicsClientId=self.client)
        return math.hypot(*linear) < self.config.settled_speed

    def move_object(self, thing: SceneObject, pose: Pose) -> None:
        """Put an object somewhere, at rest (for demonstrations without the arm, and for tests)."""
        pybullet.resetBasePositionAndOrientation(
            thing.body,
            pose.translation.tolist(),
            pose.as_quaternion_xyzw().tolist(),
            physicsClientId=self.client,
        )
        pybullet.resetBaseVelocity(thing.body, [0, 0, 0], [0, 0, 0], physicsClientId=self.client)

    def close(self) -> None:
        """Give the physics server back; the world is of no use after."""
        if self.client >= 0:
            pybullet.disconnect(physicsClientId=self.client)
            self.client = -1

    def _at_rest(self) -> bool:
        return all(thing.fixed or self.is_still(thing) for thing in self._objects)
