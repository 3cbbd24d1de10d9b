"""put-blocks-in-bowls: goal, palettes, metric, expert and the words that set a scene up."""

from collections.abc import Iterator

import pytest

from cliport_core import Pose
from sim_bridge.colors import COLORS, SEEN_PALETTE, UNSEEN_PALETTE
from sim_bridge.errors import GoalError, SimulationError, UnknownNameError
from sim_bridge.objects import SceneObject
from sim_bridge.scene import reset_scene
from sim_bridge.tasks import ColorGoal, PutBlocksInBowls, goal_colors, make_task
from sim_bridge.world import SimWorld

SEEN = "put-blocks-in-bowls-seen-colors"
UNSEEN = "put-blocks-in-bowls-unseen-colors"


@pytest.fixture(scope="module")
def world() -> Iterator[SimWorld]:
    world = SimWorld()
    yield world
    world.close()


def scene_with(world: SimWorld, n_blocks: int) -> PutBlocksInBowls:
    """The first test scene with that many target blocks."""
    for seed in range(50):
        task = reset_scene(world, SEEN, "test", seed)
        assert isinstance(task, PutBlocksInBowls)
        if task.max_steps == n_blocks + 1:
            return task
    raise AssertionError("no such scene")


def put(world: SimWorld, block: SceneObject, bowl: SceneObject, off: float = 0.0) -> None:
    x, y = world.object_xy(bowl)
    world.move_object(block, Pose.from_xyz_rpy((x + off, y, 0.03), (0.0, 0.0, 0.3)))


def test_metric_counts_blocks_within_5_cm_of_a_target_bowl(world: SimWorld) -> None:
    task = scene_with(world, 2)
    blocks = task.blocks(task.goal.block)
    bowls = task.bowls(task.goal.bowl)
    assert task.score() == 0.0 and not task.done() and task.instruction == task.goal.sentence
    put(world, blocks[0], bowls[0])
    assert task.score() == 0.5 and not task.done()
    put(world, blocks[1], bowls[1], off=0.0501)
    assert task.score() == 0.5
    put(world, blocks[1], bowls[1], off=0.0499)
    assert task.score() == 1.0 and task.done()
    assert task.instruction == "done placing blocks in bowls."
    assert task.expert_action() is None


def test_two_blocks_in_one_bowl_both_count(world: SimWorld) -> None:
    task = scene_with(world, 2)
    bowl = task.bowls(task.goal.bowl)[0]
    for block, off in zip(task.blocks(task.goal.block), (-0.021, 0.021), strict=True):
        put(world, block, bowl, off)
    assert task.score() == 1.0


def test_wrong_bowl_and_wrong_block_do_not_count(world: SimWorld) -> None:
    task = scene_with(world, 1)
    block = task.blocks(task.goal.block)[0]
    bowl = task.bowls(task.goal.bowl)[0]
    wrong_bowls = [o for o in task.bowls() if o.color != task.goal.bowl]
    wrong_blocks = [o for o in task.blocks() if o.color != task.goal.block]
    for other in wrong_bowls:
        put(world, block, other)
        assert task.score() == 0.0
    for other in wrong_blocks:
        put(world, other, bowl)
        assert task.score() == 0.0
    put(world, block, bowl)
    assert task.score() == 1.0  # whatever else is in the bowl


def test_expert_takes_the_block_farthest_from_its_nearest_free_bowl(world: SimWorld) -> None:
    task = scene_with(world, 2)
    blocks = task.blocks(task.goal.block)
    bowls = task.bowls(task.goal.bowl)

    def nearest(block: SceneObject, free: list[SceneObject]) -> float:
        x, y = world.object_xy(block)
        return min(((world.object_xy(b) - (x, y)) ** 2).sum() for b in free)

    far = max(blocks, key=lambda block: nearest(block, bowls))
    action = task.expert_action()
    assert action is not None
    assert (action.pick.x, action.pick.y) == pytest.approx(tuple(world.object_xy(far)))
    assert action.place.yaw == action.pick.yaw and abs(action.pick.yaw) <= 0.7854
    taken = min(bowls, key=lambda b: ((world.object_xy(b) - (action.place.x, action.place.y)) ** 2).sum())
    put(world, far, taken)
    following = task.expert_action()
    assert following is not None
    used = world.object_xy(taken)
    assert ((used - (following.place.x, following.place.y)) ** 2).sum() > 0.05**2


@pytest.mark.parametrize(
    ("name", "split", "palette"),
    [
        (SEEN, "train", SEEN_PALETTE),
        (SEEN, "val", SEEN_PALETTE),
        (SEEN, "test", SEEN_PALETTE),
        (UNSEEN, "train", SEEN_PALETTE),
        (UNSEEN, "val", UNSEEN_PALETTE),
        (UNSEEN, "test", UNSEEN_PALETTE),
    ],
)
def test_goal_colours_come_from_the_splits_palette(
    world: SimWorld, name: str, split: str, palette: tuple[str, ...]
) -> None:
    for seed in range(6):
        task = reset_scene(world, name, split, seed)
        assert isinstance(task, PutBlocksInBowls)
        goal = task.goal
        assert goal.block in palette and goal.bowl in palette and goal.block != goal.bowl
        others = [o.color for o in task.objects if o.color not in (goal.block, goal.bowl)]
        assert others == [c for c in COLORS if c not in (goal.block, goal.bowl)][:6]
        offered = [goal_colors(g.sentence) for g in task.goals_in_scene()]
        assert all(g.block in palette and g.bowl in palette for g in offered)
        assert goal in offered
        bowls = task.bowls(goal.bowl)
        assert 1 <= task.max_steps - 1 <= len(bowls) <= 3
        assert all(o.fixed == (o in bowls) for o in task.objects)


def test_unknown_names_and_bad_values_name_the_remedy(world: SimWorld) -> None:
    with pytest.raises(UnknownNameError, match=r"did you mean .*put-blocks-in-bowls-seen-colors"):
        reset_scene(world, "put-blocks-in-bowl-seen-colours", "test", 0)
    with pytest.raises(UnknownNameError, match="unknown split 'tset': did you mean test"):
        make_task(SEEN, "tset")
    for seed in (-1, 2**63):
        with pytest.raises(SimulationError, match=f"seed must be 0 to 9223372036854775807, got {seed}"):
            reset_scene(world, SEEN, "test", seed)


@pytest.mark.parametrize(
    ("sentence", "block", "bowl"),
    [
        ("put the red blocks in a green bowl", "red", "green"),
        ("every green cube goes into the yellow bowl, please", "green", "yellow"),
        ("Into the grey dishes, put the blue bricks!", "blue", "gray"),
        ("fill the yellow bowl with the cubes that are purple", "purple", "yellow"),
        ("move all cyan boxes to bowls coloured white", "cyan", "white"),
    ],
)
def test_words_name_a_goal(world: SimWorld, sentence: str, block: str, bowl: str) -> None:
    assert goal_colors(sentence) == ColorGoal(block, bowl)
    task = reset_scene(world, SEEN, "test", 4, sentence)
    assert isinstance(task, PutBlocksInBowls) and task.goal == ColorGoal(block, bowl)
    assert task.blocks(block) and task.bowls(bowl)


@pytest.mark.parametrize("sentence", ["tidy up", "put the red blocks away", "put the red block in a red bowl"])
def test_words_without_a_goal_are_refused(world: SimWorld, sentence: str) -> None:
    with pytest.raises(GoalError):
        reset_scene(world, SEEN, "test", 0, sentence)


@pytest.mark.parametrize("seed", range(4))
def test_distractors_of_place_red_in_green_take_the_colours_in_their_order(world: SimWorld, seed: int) -> None:
    task = reset_scene(world, "place-red-in-green", "test", seed)
    assert isinstance(task, PutBlocksInBowls)
    blocks = [color for color in COLORS if color != "red"]
    bowls = [color for color in COLORS if color != "green"]
    last = [thing for thing in task.objects if thing in (*task.blocks(), *task.bowls())][-6:]
    assert [thing.color for thing in last] == [
        (blocks if thing.name == "block" else bowls)[k] for k, thing in enumerate(last)
    ]
