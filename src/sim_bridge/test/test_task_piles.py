"""separating-piles and sweeping-piles: make-up, metric, and an expert that sweeps blocks towards the zone."""

import math
from collections.abc import Iterator

import numpy as np
import pytest

from cliport_core import PlanarPose, Pose, Primitive
from sim_bridge.colors import SEEN_PALETTE, UNSEEN_PALETTE
from sim_bridge.scene import reset_scene
from sim_bridge.task_mechanics.sweeping import HAND_DEPTH, met_by_sweep, next_sweep
from sim_bridge.tasks.separating_piles import N_BLOCKS, SeparatingPiles
from sim_bridge.world import SimWorld

SEEN, UNSEEN = "separating-piles-seen-colors", "separating-piles-unseen-colors"


@pytest.fixture(scope="module")
def world() -> Iterator[SimWorld]:
    world = SimWorld()
    yield world
    world.close()


def put(world: SimWorld, task: SeparatingPiles, inside: int, x: float = 0.0) -> None:
    """Put so many blocks into the zone, x [m] from its middle, and the others far outside."""
    goal = task.goals[0]
    for i, block in enumerate(goal.objects):
        at = Pose.from_xyz_rpy((x if i < inside else 0.3, 0.0, 0.005), (0.0, 0.0, 0.0))
        world.move_object(block, goal.targets[0] @ at)


def test_the_share_of_blocks_inside_counts(world: SimWorld) -> None:
    task = reset_scene(world, SEEN, "val", 0)
    assert isinstance(task, SeparatingPiles)
    for inside, score, done in ((50, 1.0, True), (49, 0.98, False), (25, 0.5, False), (0, 0.0, False)):
        put(world, task, inside)
        assert task.score() == pytest.approx(score) and task.done() == done
    put(world, task, 50, x=0.0798)  # the corner at -5 mm is what counts: 74.8 mm
    assert task.score() == 1.0
    put(world, task, 50, x=0.0802)
    assert task.score() == 0.0


@pytest.mark.parametrize(
    ("name", "split", "palette"),
    [(SEEN, "test", SEEN_PALETTE), (UNSEEN, "train", SEEN_PALETTE), (UNSEEN, "test", UNSEEN_PALETTE)],
)
def test_three_colours_of_the_palette(world: SimWorld, name: str, split: str, palette: tuple[str, ...]) -> None:
    asked = set()
    for seed in range(6):
        task = reset_scene(world, name, split, seed)
        zones, blocks = task.objects[:2], task.objects[2:]
        assert len(blocks) == N_BLOCKS and len({b.color for b in blocks}) == 1
        colors = {zones[0].color, zones[1].color, blocks[0].color}
        assert len(colors) == 3 and colors <= set(palette)
        assert np.linalg.norm(world.object_xy(zones[0]) - world.object_xy(zones[1])) >= 0.2
        named = [z.color for z in zones if f"into the {z.color} square" in task.instruction]
        assert len(named) == 1 and f"pile of {blocks[0].color} blocks" in task.instruction
        asked.add(named[0] == zones[0].color)
    assert asked == {True, False}


def test_sweeping_piles_counts_what_is_drawn(world: SimWorld) -> None:
    task = reset_scene(world, "sweeping-piles", "val", 0)
    assert task.instruction == "push the pile of blocks into the green square" and len(task.objects) == 1 + N_BLOCKS
    put(world, task, 50, x=0.064)  # type: ignore[arg-type]
    assert task.score() == 1.0
    put(world, task, 50, x=0.066)  # type: ignore[arg-type]
    assert task.score() == 0.0


def test_the_expert_sweeps_blocks_into_the_zone(world: SimWorld) -> None:
    for seed in range(4):
        task = reset_scene(world, SEEN, "val", seed)
        action = task.expert_action()
        assert action is not None and action.primitive is Primitive.SWEEP
        spec = world.config.workspace
        assert spec.contains_xy(action.pick.x, action.pick.y) and spec.contains_xy(action.place.x, action.place.y)
        choice = task.judge(action.pick, action.place)
        assert choice.pick_right and choice.picked.endswith("block")


def test_the_same_seed_is_the_same_pile(world: SimWorld) -> None:
    def where() -> list[list[float]]:
        return [world.object_pose(o).translation.tolist() for o in reset_scene(world, SEEN, "val", 3).objects]

    first = where()
    reset_scene(world, SEEN, "val", 4)
    assert where() == first


def test_a_sweep_stops_short_of_the_middle(world: SimWorld) -> None:
    spec, zone = world.config.workspace, PlanarPose(0.5, 0.1, 0.0)
    things = np.array([[0.5, 0.1], [0.5, 0.1 - 0.06], [0.35, 0.3]])
    sweep = next_sweep(things[:2], zone, 0.12, spec)
    assert sweep is not None
    start, end = sweep
    assert start.y < things[1, 1]
    assert math.hypot(end.x - zone.x, end.y - zone.y) == pytest.approx(0.03)
    assert met_by_sweep(things, start, end).tolist() == [False, True, False]
    assert met_by_sweep(things, start, start).tolist() == [False] * 3
    assert next_sweep(things[:1], zone, 0.12, spec) is None


@pytest.mark.parametrize("yaw", [0.0, 0.5, math.pi / 4])
def test_the_last_ones_are_swept_to_just_inside_the_edge(world: SimWorld, yaw: float) -> None:
    """A row from the edge to the far edge would be pushed out by a hand that goes on to near the middle."""
    zone = PlanarPose(0.5, 0.0, yaw)
    edge = 0.06 / max(abs(math.cos(yaw)), abs(math.sin(yaw)))
    row = [[0.5 + along, across] for along in np.arange(-edge + 0.025, edge, 0.011) for across in (-0.01, 0.0, 0.01)]
    things = np.array([[0.5 - edge - 0.004, 0.0], *row])
    sweep = next_sweep(things, zone, 0.12, world.config.workspace)
    assert sweep is not None
    start, end = sweep
    assert start.x < things[0, 0] and 0.0 < things[1, 0] - end.x < 0.03  # the hand stops at the row's beginning
    pushed_to = end.x + (HAND_DEPTH + 0.01) / 2.0
    assert pushed_to == pytest.approx(0.5 - edge + 0.011, abs=0.002)
