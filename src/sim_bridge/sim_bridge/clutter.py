"""Adds things that no sentence names to a task's scene, on free ground (docs/benchmark.md, "World and observation")."""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from cliport_core import PlanarPose, Primitive, WorkspaceSpec
from sim_bridge.errors import SimulationError
from sim_bridge.objects import SceneObject, Shape
from sim_bridge.objects.clutter_shapes import CLUTTER_PAINTS, clutter_shapes
from sim_bridge.task_mechanics.goal import Goal, ZoneMetric
from sim_bridge.task_mechanics.goal_task import GoalTask
from sim_bridge.task_mechanics.placing import (
    BORDER,
    FINGER_CLEARANCE,
    GAP,
    border_distance,
    distance_to_things,
    is_graspable,
    outline,
)
from sim_bridge.task_mechanics.task import Task
from sim_bridge.world import SimWorld

Disc = tuple[float, float, float]  # x, y and radius [m]


@dataclass(frozen=True)
class ClutterConfig:
    """Range of the number of things that are added, `least` to `most`; margin: around all that is swept or folded [m].

    Raises:
        SimulationError: when that is no range.
    """

    least: int = 2
    most: int = 5
    margin: float = 0.08

    def __post_init__(self) -> None:
        if not 0 <= self.least <= self.most:
            raise SimulationError(f"clutter of {self.least} to {self.most} things: give a range from 0 on")


def add_clutter(
    world: SimWorld, task: Task, rng: np.random.Generator, config: ClutterConfig | None = None
) -> list[SceneObject]:
    """Add a few things to a scene that was set up and let the world settle; return them.

    They keep clear of the task's things, of their targets and of where others will appear; where nothing is free they
    become fewer. No goal has them, so they change no score.

    Raises:
        PhysicsError: when objects flew apart.
    """
    config = config or ClutterConfig()
    kept_free, taken = _kept_free(world, task, config), _to_be_taken(task, world)
    added = []
    for _ in range(int(rng.integers(config.least, config.most + 1))):
        shape = clutter_shapes()[int(rng.integers(len(clutter_shapes())))]
        paint = CLUTTER_PAINTS[int(rng.integers(len(CLUTTER_PAINTS)))]
        pose = _free_pose(world, shape, kept_free, taken, rng)
        if pose is not None:
            added.append(world.add(shape, pose.as_pose(-shape.bottom), paint=paint))
    world.settle()
    return added


def _to_be_taken(task: Task, world: SimWorld) -> list[SceneObject]:
    """Return the things that the hand may take: those with pinches, and everyday objects, whose pinches are looked for
    as they lie."""
    wanted = [thing for goal in task.goals for thing in goal.objects] if isinstance(task, GoalTask) else []
    if all(thing.shape.pinches for thing in wanted):
        return [thing for thing in world.objects if is_graspable(thing)]
    return [thing for thing in world.objects if not thing.fixed]


def _free_pose(
    world: SimWorld,
    shape: Shape,
    kept_free: npt.NDArray[np.float64],
    taken: list[SceneObject],
    rng: np.random.Generator,
) -> PlanarPose | None:
    """Return a pose drawn uniformly from all free ones; None where there is none. Both draw equally often from rng."""
    workspace = world.config.workspace
    free = distance_to_things(world, world.objects) >= shape.radius + GAP
    free &= distance_to_things(world, taken) >= shape.radius + FINGER_CLEARANCE
    free &= border_distance(workspace) >= shape.radius + BORDER
    free &= kept_free >= shape.radius
    chosen, yaw = float(rng.random()), float(rng.uniform(-math.pi, math.pi))
    cells = np.flatnonzero(free)
    if len(cells) == 0:
        return None
    row, col = divmod(int(cells[int(chosen * len(cells))]), workspace.cols)
    return PlanarPose(*workspace.pixel_to_xy(row, col), yaw)


def _kept_free(world: SimWorld, task: Task, config: ClutterConfig) -> npt.NDArray[np.float64]:
    """Return (rows, cols) distance from each pixel to the nearest place that the task needs [m], negative within it."""
    workspace = world.config.workspace
    discs = _target_discs(task)
    distance = np.full(workspace.shape, np.inf)
    x, y = _pixel_centres(workspace)
    for at_x, at_y, radius in discs:
        distance = np.minimum(distance, np.hypot(x - at_x, y - at_y) - radius)
    if task.primitive is not Primitive.PICK_PLACE:
        distance = np.minimum(distance, _hull_distance(world, discs) - config.margin)
    return distance


def _target_discs(task: Task) -> list[Disc]:
    """Return a disc around every target, wide enough for fingers beside the largest thing that may come there."""
    if not isinstance(task, GoalTask):
        return []
    discs = [disc for goal in task.goals for disc in _discs_of(goal)]
    return [*discs, *((place.x, place.y, radius + FINGER_CLEARANCE) for place, radius in task.arrivals)]


def _discs_of(goal: Goal) -> list[Disc]:
    zone = 0.0
    centres = list(goal.targets)
    if isinstance(goal.metric, ZoneMetric):
        zone = math.hypot(*goal.metric.size) / 2
        centres = [goal.metric.about] if goal.metric.about else centres
    reach = max([zone, *(thing.shape.radius for thing in goal.objects)])
    places = {(round(float(c.translation[0]), 4), round(float(c.translation[1]), 4)) for c in centres}
    return [(x, y, reach + FINGER_CLEARANCE) for x, y in sorted(places)]


def _hull_distance(world: SimWorld, discs: list[Disc]) -> npt.NDArray[np.float64]:
    """Return (rows, cols) distance from each pixel to the convex hull of all things and all targets [m]."""
    workspace = world.config.workspace
    corners = [outline(world, thing) for thing in world.objects] + [np.array([[x, y]]) for x, y, _ in discs]
    hull = cv2.convexHull(np.concatenate(corners).astype(np.float32)).reshape(-1, 2)
    outside = np.full(workspace.shape, 255, dtype=np.uint8)
    pixels = (hull - (workspace.x_min, workspace.y_min)) / workspace.pixel_size - 0.5
    cv2.fillConvexPoly(outside, np.rint(pixels * 16).astype(np.int32), 0, shift=4)
    return cv2.distanceTransform(outside, cv2.DIST_L2, cv2.DIST_MASK_PRECISE).astype(np.float64) * workspace.pixel_size


def _pixel_centres(workspace: WorkspaceSpec) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """Return the pixels' centres, x (cols,) and y (rows, 1) [m]."""
    x = workspace.x_min + (np.arange(workspace.cols, dtype=np.float64) + 0.5) * workspace.pixel_size
    y = workspace.y_min + (np.arange(workspace.rows, dtype=np.float64) + 0.5) * workspace.pixel_size
    return x, y[:, None]
