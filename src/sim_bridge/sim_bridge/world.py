"""The simulated world: a table, a Panda and one task's objects in one PyBullet client."""

from __future__ import annotations

import zlib
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from cliport_perception import Pose, WorkspaceSpec
from sim_bridge.bullet import pybullet
from sim_bridge.errors import SimulationError
from sim_bridge.objects import SceneObject, body_pose, spawn_block, spawn_bowl
from sim_bridge.panda import PandaArm
from sim_bridge.tasks import Split, make_task
from sim_bridge.tasks.base import Task


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

    def __post_init__(self) -> None:
        if self.rate_hz < 60 or self.solver_iterations < 1:
            raise SimulationError(
                f"physics needs rate_hz >= 60 and solver_iterations >= 1, "
                f"got {self.rate_hz} and {self.solver_iterations}"
            )


def scene_rng(task_name: str, split: Split, seed: int, stream: int = 0) -> np.random.Generator:
    """The random numbers of one scene: the same seed in two splits or tasks gives different scenes.

    stream: 0 for the scene itself; others are independent of it, for noise and variations around that scene.

    Raises:
        SimulationError: when the seed is negative.
    """
    if seed < 0:
        raise SimulationError(f"seed must be 0 or more, got {seed}")
    key = [zlib.crc32(task_name.encode()), list(Split).index(split), seed]
    return np.random.default_rng(np.random.SeedSequence(key, spawn_key=(stream,) if stream else ()))


class SimWorld:
    """Owns one PyBullet client; the same calls give the same states, always.

    World frame = base frame (panda_link0): x forward, y left, z up, the table's top at z = 0. Simulated time
    runs on over resets, so that it can drive a clock.
    """

    def __init__(self, config: SimConfig | None = None) -> None:
        self.config = config or SimConfig()
        self.client: int = pybullet.connect(pybullet.DIRECT)
        if self.client < 0:
            raise SimulationError("PyBullet gave no physics server; close other worlds of this process first")
        self._steps = 0
        self._objects: list[SceneObject] = []
        self._task: Task | None = None
        self.panda: PandaArm
        self._build()

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
        """The task's objects."""
        return tuple(self._objects)

    @property
    def task(self) -> Task | None:
        """What `reset` set up last."""
        return self._task

    def reset(self, task_name: str, split: str, seed: int, instruction: str = "") -> Task:
        """A fresh scene with the arm at home: the same arguments give the same scene.

        instruction: when not empty, the scene is made for the goal that it names.

        Raises:
            UnknownNameError: on an unknown task or split, naming the nearest ones.
            GoalError: when the instruction names no goal that the task knows.
            LayoutError: when the objects found no room.
            SimulationError: on a negative seed.
        """
        task = make_task(task_name, split, instruction)
        rng = scene_rng(task.name, task.split, seed)
        self._build()
        task.reset(self, rng)
        self.settle()
        self._task = task
        return task

    def step(self) -> None:
        """Advance physics by one step."""
        pybullet.stepSimulation(physicsClientId=self.client)
        self._steps += 1

    def settle(self) -> bool:
        """Step until every object rests or `max_settle_s` passed; whether they rest."""
        for i in range(round(self.config.max_settle_s * self.config.rate_hz)):
            if i >= 24 and self._at_rest():
                return True
            self.step()
        return self._at_rest()

    def add_block(self, color: str, x: float, y: float, yaw: float) -> SceneObject:
        """A cube on the table (see objects)."""
        return self._added(spawn_block(self.client, color, x, y, yaw))

    def add_bowl(self, color: str, x: float, y: float, yaw: float, fixed: bool) -> SceneObject:
        """A bowl on the table (see objects)."""
        return self._added(spawn_bowl(self.client, color, x, y, yaw, fixed))

    def object_pose(self, thing: SceneObject) -> Pose:
        """Pose of the object's centre in the base frame."""
        return body_pose(self.client, thing.body)

    def object_xy(self, thing: SceneObject) -> npt.NDArray[np.float64]:
        """(2,) centre of the object [m]."""
        return self.object_pose(thing).translation[:2]

    def object_yaw(self, thing: SceneObject) -> float:
        """Turn of the object about z [rad], of the block's horizontal edges where it lies on another face."""
        rotation = self.object_pose(thing).rotation
        flat = int(np.argmin(np.abs(rotation[2])))  # an axis of the body that lies nearly level
        return float(np.arctan2(rotation[1, flat], rotation[0, flat]))

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

    def _added(self, thing: SceneObject) -> SceneObject:
        self._objects.append(thing)
        return thing

    def _at_rest(self) -> bool:
        for thing in self._objects:
            if thing.fixed:
                continue
            linear, _ = pybullet.getBaseVelocity(thing.body, physicsClientId=self.client)
            if np.linalg.norm(linear) >= self.config.settled_speed:
                return False
        return True

    def _build(self) -> None:
        """Everything anew, so that nothing of the last scene can reach this one."""
        pybullet.resetSimulation(physicsClientId=self.client)
        pybullet.setGravity(0.0, 0.0, -self.config.gravity, physicsClientId=self.client)
        pybullet.setPhysicsEngineParameter(
            fixedTimeStep=self.dt,
            numSolverIterations=self.config.solver_iterations,
            deterministicOverlappingPairs=1,
            physicsClientId=self.client,
        )
        self._objects = []
        self._task = None
        plane = pybullet.createCollisionShape(pybullet.GEOM_PLANE, physicsClientId=self.client)
        table = pybullet.createMultiBody(0.0, plane, physicsClientId=self.client)
        pybullet.changeDynamics(table, -1, lateralFriction=self.config.table_friction, physicsClientId=self.client)
        self.panda = PandaArm(self.client)
