"""Common part of both assembling-kits tasks: a kit with five prints, and a loose shape for each."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cliport_core import PlanarPose, Pose
from sim_bridge.errors import LayoutError
from sim_bridge.objects import SceneObject
from sim_bridge.objects.kit import HOLES_IN_KIT, KIT_SIZE, hole_poses, hole_shape, kit_slab
from sim_bridge.objects.kit_shapes import KIT_SHAPES, SEEN_SHAPES, THICKNESS, UNSEEN_SHAPES, kit_shape
from sim_bridge.task_mechanics.goal import Goal
from sim_bridge.task_mechanics.goal_task import GoalTask
from sim_bridge.task_mechanics.placing import BORDER, free_pose
from sim_bridge.task_mechanics.task import Split
from sim_bridge.world import SimWorld

N_HOLES = len(HOLES_IN_KIT)


def kit_shapes_of(split: Split) -> tuple[int, ...]:
    """Return the shapes that a split uses: others in validation and test than in training."""
    return SEEN_SHAPES if split is Split.TRAIN else UNSEEN_SHAPES


@dataclass(frozen=True, eq=False)
class Fit:
    """A loose shape, and the print of the kit that was made for it."""

    index: int
    thing: SceneObject
    hole: SceneObject
    hole_pose: Pose

    @property
    def period(self) -> float:
        """Angle by which the shape may be turned without a difference to the metric [rad]."""
        return KIT_SHAPES[self.index].period


class KitTask(GoalTask):
    """Spawns the kit and its shapes; a subclass draws colours and goals."""

    done_sentence = "done assembling kit."

    def place_level(self, goal: Goal, thing: SceneObject) -> float:
        """Return the height of the slab, on which every shape goes."""
        return KIT_SIZE[2]

    def spawn(
        self, world: SimWorld, rng: np.random.Generator, colors: Sequence[str], shapes: Sequence[int]
    ) -> list[Fit]:
        """Create a fixed kit, five prints of shapes drawn from `shapes` with
        repetition, and the loose shapes in `colors`.

        Raises:
            LayoutError: when a shape found no free place.
        """
        drawn = [int(index) for index in rng.choice(shapes, size=N_HOLES)]
        slab = world.add(kit_slab(), _kit_pose(world, rng).as_pose(KIT_SIZE[2] / 2), fixed=True)
        holes = []
        for index, at in zip(drawn, hole_poses(world.object_pose(slab)), strict=True):
            x, y, z = at.translation
            pose = PlanarPose(x, y, float(rng.uniform(-math.pi, math.pi))).as_pose(z)
            holes.append((world.add(hole_shape(index), pose, fixed=True), pose))
        things = []
        for index, color in zip(drawn, colors, strict=True):
            shape = kit_shape(index)
            things.append(world.add(shape, free_pose(world, shape, rng).as_pose(THICKNESS / 2), color))
        return [Fit(i, thing, *hole) for i, thing, hole in zip(drawn, things, holes, strict=True)]


def _kit_pose(world: SimWorld, rng: np.random.Generator) -> PlanarPose:
    """Draw a pose on the empty table at which the turned slab fits; for the disc around it there would be few.

    Raises:
        LayoutError: when it fits nowhere with the yaw that was drawn.
    """
    spec = world.config.workspace
    yaw = float(rng.uniform(-math.pi, math.pi))
    c, s = abs(math.cos(yaw)), abs(math.sin(yaw))
    half_x = (c * KIT_SIZE[0] + s * KIT_SIZE[1]) / 2 + BORDER
    half_y = (s * KIT_SIZE[0] + c * KIT_SIZE[1]) / 2 + BORDER
    width, depth = spec.x_max - spec.x_min, spec.y_max - spec.y_min
    if width < 2 * half_x or depth < 2 * half_y:
        raise LayoutError(
            f"no place for a kit of {1000 * KIT_SIZE[0]:.0f} mm x {1000 * KIT_SIZE[1]:.0f} mm on {width:.2f} m x "
            f"{depth:.2f} m; use a larger workspace"
        )
    x = rng.uniform(spec.x_min + half_x, spec.x_max - half_x)
    y = rng.uniform(spec.y_min + half_y, spec.y_max - half_y)
    return PlanarPose(float(x), float(y), yaw)
