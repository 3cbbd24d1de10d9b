"""packing-boxes: fill the brown box with the boxes that it was cut into.

See docs/benchmark.md, "packing-boxes".
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from cliport_core import Pose
from sim_bridge.colors import COLORS
from sim_bridge.objects import SceneObject, container_shape, cuboid
from sim_bridge.objects.block import BOX_MASS, WIDEST_PINCH
from sim_bridge.objects.container import CONTAINER_HEIGHT, WALL
from sim_bridge.robot import HAND
from sim_bridge.task_mechanics.goal import Goal, ZoneMetric, lattice
from sim_bridge.task_mechanics.goal_task import GoalTask
from sim_bridge.task_mechanics.placing import free_outline_pose
from sim_bridge.tasks.box_partition import Cell, random_packing
from sim_bridge.world import SimWorld

BOX_HEIGHT = 0.05  # [m]

_SIDES = (0.05, 0.30)  # of the container [m]
_SHORTEST = 0.05  # side of a cell after a cut, with half a gap [m]
_FINGER_CLEARANCE = HAND.finger_thickness + 0.0088  # beside a box: an opened finger, with a margin [m]


class PackingBoxes(GoalTask):
    """Task with a fixed container and the boxes that fill its cells, all over the table, in any colour but its own."""

    done_sentence = "done packing boxes."
    z_cap = 0.08  # greatest height above the container's middle of points that count [m]

    def set_up(self, world: SimWorld, rng: np.random.Generator) -> Sequence[Goal]:
        """Create the container and its boxes, and return the goal."""
        packing = random_packing(_SIDES, _SHORTEST, _can_be_held, rng)
        container = add_container(world, packing.width, packing.depth, rng)
        colors = self.draw_colors(len(packing.cells), rng)
        boxes = [add_box(world, cell, color, rng) for cell, color in zip(packing.cells, colors, strict=True)]
        self.add_distractors(world, packing.cells, rng)
        pose = world.object_pose(container)
        targets = [pose @ Pose.from_xyz_rpy((cell.x, cell.y, WALL), (0.0, 0.0, 0.0)) for cell in packing.cells]
        size = (packing.width, packing.depth)
        points = tuple(_points_of(cell) for cell in packing.cells)
        return (
            Goal(
                self.sentence,
                tuple(boxes),
                tuple(targets),
                np.eye(len(boxes), dtype=bool),
                ZoneMetric(size, points, self.z_cap, pose),
                max_reward=1.0,
                target_name=container.name,
            ),
        )

    @property
    def sentence(self) -> str:
        """Sentence of the scene's goal."""
        return "pack all the boxes inside the brown box"

    @property
    def max_steps(self) -> int:
        """Twenty, in every scene."""
        return 20

    def place_level(self, goal: Goal, thing: SceneObject) -> float:
        """Return the height of the container's floor."""
        return WALL

    def draw_colors(self, count: int, rng: np.random.Generator) -> list[str]:
        """Draw a colour for each box."""
        choice = [color for color in COLORS if color != "brown"]
        return [choice[i] for i in rng.integers(len(choice), size=count)]

    def add_distractors(self, world: SimWorld, cells: Sequence[Cell], rng: np.random.Generator) -> None:
        """Put things on the table that are not to be packed; here none."""


def add_container(world: SimWorld, width: float, depth: float, rng: np.random.Generator) -> SceneObject:
    """Add a fixed container of that outer size [m] somewhere on the table.

    Raises:
        LayoutError: when there is no free place.
    """
    shape = container_shape(width, depth)
    at = free_outline_pose(world, shape, rng, clearance=0.0)
    return world.add(shape, at.as_pose(CONTAINER_HEIGHT / 2), fixed=True)


def add_box(world: SimWorld, cell: Cell, color: str, rng: np.random.Generator) -> SceneObject:
    """Add a box of a cell's size somewhere on the table.

    Raises:
        LayoutError: when there is no free place.
    """
    shape = cuboid("box", _size_of(cell), BOX_MASS)
    return world.add(shape, free_outline_pose(world, shape, rng, _FINGER_CLEARANCE).as_pose(BOX_HEIGHT / 2), color)


def _size_of(cell: Cell) -> tuple[float, float, float]:
    return cell.width, cell.depth, BOX_HEIGHT


def _can_be_held(cell: Cell) -> bool:
    return min(cell.width, cell.depth) <= WIDEST_PINCH


def _points_of(cell: Cell) -> npt.NDArray[np.float64]:
    """Return the points of a box that count in the container, (N, 3) [m, body frame]."""
    size = np.array(_size_of(cell))
    return lattice(-size / 2, size)
