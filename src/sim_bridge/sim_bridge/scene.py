"""Sets a task's scene up in a world: the same task, split and seed give the same scene, always."""

from __future__ import annotations

import zlib
from enum import IntEnum

import numpy as np

from sim_bridge.errors import LayoutError, PhysicsError, SimBridgeError, SimulationError, TaskPackageError
from sim_bridge.task_mechanics.task import Split, Task
from sim_bridge.tasks.registry import added_tasks, make_task
from sim_bridge.world import SimWorld


class Stream(IntEnum):
    """The random numbers of a scene, each independent of the others: part of every result and data set."""

    SCENE = 0
    NOISE = 1  # of the camera, in demonstrations
    HAND = 2  # inaccuracy of a hand that moves things without the arm
    GOALS = 3  # that are asked for beside a scene's own
    SCORED_NOISE = 4  # of the camera, in evaluations
    CHANCE = 5  # an agent that chooses at random
    AGENT = 6  # the agent that is scored
    PAINT = 7  # what the benchmark's colours look like and are called instead
    MISTAKES = 8  # that a demonstrator makes and puts right
    CLUTTER = 16


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
        TaskPackageError: when the task of another package fails in some other way.
    """
    task = make_task(task_name, split, instruction)
    rng = scene_rng(task.name, task.split, seed)
    for drawn in range(world.config.max_layouts):
        world.clear()
        try:
            _set_up(task, world, rng)
            world.settle()
            task.redraws = drawn
            break
        except (LayoutError, PhysicsError):
            if drawn + 1 == world.config.max_layouts:
                raise
    return task


def _set_up(task: Task, world: SimWorld, rng: np.random.Generator) -> None:
    try:
        task.reset(world, rng)
    except SimBridgeError:
        raise
    except Exception as error:
        if task.name not in added_tasks():
            raise
        why = f"its scene cannot be made ({type(error).__name__}: {error})"  # what a foreign module does is its own
        raise TaskPackageError(task.name, why) from error


def scene_rng(task_name: str, split: Split, seed: int, stream: int = Stream.SCENE) -> np.random.Generator:
    """Return the random numbers of one scene: the same seed in two splits or tasks gives different scenes.

    stream: one of Stream; those beside the scene's own are for noise and variations around it.

    Raises:
        SimulationError: when the seed is negative or has more than 63 bits.
    """
    if not 0 <= seed <= LARGEST_SEED:
        raise SimulationError(f"seed must be 0 to {LARGEST_SEED}, got {seed}")
    key = [zlib.crc32(task_name.encode()), list(Split).index(split), seed]
    return np.random.default_rng(np.random.SeedSequence(key, spawn_key=(int(stream),) if stream else ()))
