"""separating-piles and sweeping-piles: a pile of small blocks into a square.

See docs/benchmark.md, "separating-piles" and "sweeping-piles".
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from cliport_core import PickPlaceAction, PlanarPose, Pose, Primitive
from sim_bridge.errors import LayoutError
from sim_bridge.objects import SceneObject
from sim_bridge.objects.corner import PURE_GREEN
from sim_bridge.objects.pile import PILE_BLOCK_SIZE, ZONE_OUTLINE, pile_block_shape, zone_shape
from sim_bridge.sleeping import let_sleep
from sim_bridge.task_mechanics.goal import Goal, ZoneMetric, lattice
from sim_bridge.task_mechanics.goal_task import GoalTask
from sim_bridge.task_mechanics.placing import free_pose
from sim_bridge.task_mechanics.sweeping import next_sweep, on_the_way
from sim_bridge.task_mechanics.task import JudgedAction, Split
from sim_bridge.tasks.variants import Variant
from sim_bridge.world import SimWorld

N_BLOCKS = 50
SEPARATING_ZONE = 0.15  # edge of the zone that counts when piles are separated [m]
ZONE_DISTANCE = 0.2  # between the middles of two zones at least [m]
PILE_EDGE = 0.2  # of the square about the workspace's middle in which the blocks lie [m]

_PILE_HEIGHT = 0.01  # from which the blocks fall [m]
_DRAWS = 20  # of a pair of zones, at most
_CORNER = lattice((-PILE_BLOCK_SIZE / 2,) * 3, (PILE_BLOCK_SIZE,) * 3)


class _PileTask(GoalTask):
    """Common part of the tasks with fifty small blocks scattered in the middle,
    and zones, only seen; the closed hand sweeps."""

    primitive = Primitive.SWEEP

    @property
    def max_steps(self) -> int:
        """Twenty sweeps."""
        return 20

    def expert_action_for(self, goal: Goal) -> PickPlaceAction | None:
        """Return the sweep that brings the most blocks into the zone."""
        world = self.world
        zone = PlanarPose.from_pose(goal.targets[0])
        sweep = next_sweep(self._block_xy(goal), zone, _edge(goal), world.config.workspace)
        return None if sweep is None else PickPlaceAction(*sweep, Primitive.SWEEP)

    def judge(self, pick: PlanarPose, place: PlanarPose, exact_offset: bool = False) -> JudgedAction:
        """Judge a sweep, which picks the blocks on its way: it is right when one of
        them lies outside, and when it ends inside."""
        goal = self.present_goal
        zones = [thing for thing in self.objects if thing.shape is zone_shape()]
        under = next((z for z in zones if _contains(self.world.object_pose(z), place, ZONE_OUTLINE)), None)
        name = under.described if under else ""
        if goal is None:
            return JudgedAction("", name, False, False)
        blocks = self._block_xy(goal)
        swept = np.flatnonzero(on_the_way(blocks, pick, place))
        outside = any(not goal.allows(goal.objects[i], *blocks[i]) for i in swept)
        picked = goal.objects[0].described if len(swept) else ""
        return JudgedAction(picked, name, outside, _contains(goal.targets[0], place, _edge(goal)))

    def _block_xy(self, goal: Goal) -> npt.NDArray[np.float64]:
        return np.array([self.world.object_xy(block) for block in goal.objects])


class SeparatingPiles(_PileTask):
    """Task with blocks of one colour that go into the zone of the colour
    that is asked for; another zone is beside it."""

    sentence_pattern = "push the pile of {color} blocks into the {zone} square"
    done_sentence = "done separating pile."

    def __init__(self, name: str, split: Split, variant: Variant) -> None:
        super().__init__(name, split)
        self.palette = variant.palette(split)

    def set_up(self, world: SimWorld, rng: np.random.Generator) -> Sequence[Goal]:
        """Create two zones and the blocks, and return the goal."""
        *zone_colors, block_color = (self.palette[i] for i in rng.choice(len(self.palette), size=3, replace=False))
        zones = _zone_poses(world, rng)
        for pose, color in zip(zones, zone_colors, strict=True):
            world.add(zone_shape(), pose, color, fixed=True)
        blocks = _add_blocks(world, rng, block_color)
        asked = int(rng.integers(2))
        sentence = f"push the pile of {block_color} blocks into the {zone_colors[asked]} square"
        return (_goal(sentence, blocks, zones[asked], SEPARATING_ZONE),)

    def goals_without_words(self) -> Sequence[Goal]:
        """Return two goals: the blocks in either zone."""
        zones = [self.world.object_pose(thing) for thing in self.objects if thing.shape is zone_shape()]
        blocks = tuple(thing for thing in self.objects if thing.shape is pile_block_shape())
        return [_goal("", blocks, zone, SEPARATING_ZONE) for zone in zones]


class SweepingPiles(_PileTask):
    """Task with red blocks that go into the green zone; the outline that is drawn is the zone that counts."""

    done_sentence = "done sweeping."

    def set_up(self, world: SimWorld, rng: np.random.Generator) -> Sequence[Goal]:
        """Create the zone and the blocks, and return the goal."""
        zone = free_pose(world, zone_shape(), rng, graspable=False).as_pose()
        world.add(zone_shape(), zone, paint=PURE_GREEN, fixed=True)
        blocks = _add_blocks(world, rng, "red")
        return (_goal("push the pile of blocks into the green square", blocks, zone, ZONE_OUTLINE),)


def _zone_poses(world: SimWorld, rng: np.random.Generator) -> list[Pose]:
    """Draw two poses, far enough apart.

    Raises:
        LayoutError: when none were drawn.
    """
    radius = SEPARATING_ZONE * math.sqrt(0.5)
    for _ in range(_DRAWS):
        first, second = (free_pose(world, zone_shape(), rng, graspable=False, radius=radius) for _ in range(2))
        if math.hypot(first.x - second.x, first.y - second.y) >= ZONE_DISTANCE:
            return [first.as_pose(), second.as_pose()]
    raise LayoutError(f"no two zones {ZONE_DISTANCE} m apart were drawn")


def _add_blocks(world: SimWorld, rng: np.random.Generator, color: str) -> tuple[SceneObject, ...]:
    """Add the blocks, which fall onto a square about the workspace's middle."""
    spec = world.config.workspace
    middle = np.array([spec.x_min + spec.x_max, spec.y_min + spec.y_max]) / 2
    blocks = []
    for _ in range(N_BLOCKS):
        x, y = middle + rng.uniform(-PILE_EDGE / 2, PILE_EDGE / 2, 2)
        pose = PlanarPose(float(x), float(y), float(rng.uniform(-math.pi, math.pi))).as_pose(_PILE_HEIGHT)
        blocks.append(world.add(pile_block_shape(), pose, color))
    let_sleep(world, blocks)
    return tuple(blocks)


def _goal(sentence: str, blocks: tuple[SceneObject, ...], zone: Pose, edge: float) -> Goal:
    """Return the goal of all blocks inside; a block's lowest corner says where it is (docs/benchmark.md, "Scores")."""
    metric = ZoneMetric((edge, edge), (_CORNER,) * len(blocks))
    matches = np.ones((len(blocks), 1), dtype=bool)
    return Goal(sentence, blocks, (zone,), matches, metric, max_reward=1.0, turn=False, replace=True)


def _edge(goal: Goal) -> float:
    assert isinstance(goal.metric, ZoneMetric)
    return goal.metric.size[0]


def _contains(zone: Pose, at: PlanarPose, edge: float) -> bool:
    local = zone.inverse().apply(np.array([at.x, at.y, 0.0]))
    return bool((np.abs(local[:2]) < edge / 2).all())
