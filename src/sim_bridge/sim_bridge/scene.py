"""Sets a task's scene up in a world: the same task, split and seed give the same scene, always."""

from __future__ import annotations

import zlib

import numpy as np

from sim_bridge.errors import LayoutError, PhysicsError, SimulationError
from sim_bridge.task_mechanics.task import Split, Task
from sim_bridge.tasks.registry import make_task
from sim_bridge.world import SimWorld

LARGEST_SEED = 2**63 - 1  # what files and messages hold


def reset_scene(world: SimWorld, task_name: str, split: str, seed: int, instruction: str = "") -> Task:
    """Make a task's scene in an emptied world with the arm at home, and return the task.

    A scene in which a thing finds no free place, or whose objects fly apart, is drawn again: the task's `redraws`.
    instruction: when not empty, the scene is made for the goal that it names.

    Raises:
        UnknownNameError: on an unknown task or split, naming the nearest ones.
        GoalError: when the instruction names no goal that the task knows.
        LayoutError: when an object found no free place in `max_layouts` drawn scenes.
        PhysicsError: when the objects flew apart in the last of them.
        SimulationError: on a seed out of range.
    """
    task = make_task(task_name, split, instruction)
    rng = scene_rng(task.name, task.split, seed)
    for drawn in range(world.config.max_layouts):
        world.clear()
        try:
            task.reset(world, rng)
            world.settle()
            task.redraws = drawn
            break
        except (LayoutError, PhysicsError):
            if drawn + 1 == world.config.max_layouts:
                raise
    return task


def scene_rng(task_name: str, split: Split, seed: int, stream: int = 0) -> np.random.Generator:
    """Return the random numbers of one scene: the same seed in two splits or tasks gives different scenes.

    stream: 0 for the scene itself; others are independent of it, for noise and variations around that scene.

    Raises:
        SimulationError: when the seed is negative or has more than 63 bits.
    """
    if not 0 <= seed <= LARGEST_SEED:
        raise SimulationError(f"seed must be 0 to {LARGEST_SEED}, got {seed}")
    key = [zlib.crc32(task_name.encode()), list(Split).index(split), seed]
    return np.random.default_rng(np.random.SeedSequence(key, spawn_key=(stream,) if stream else ()))
