"""Chance: what a random block into a random bowl scores, against counting by hand."""

from types import SimpleNamespace

import numpy as np
import pytest

from sim_bridge.scene import reset_scene
from sim_bridge.tasks import ColorGoal, PutBlocksInBowls
from sim_bridge.world import SimWorld

SEEN = "put-blocks-in-bowls-seen-colors"


def test_chance_lies_where_counting_says() -> None:
    world = SimWorld()
    for seed in range(20):
        task = reset_scene(world, SEEN, "test", seed)
        assert isinstance(task, PutBlocksInBowls)
        blocks = [o.color for o in task.objects if o.name == "block"]
        bowls = [o.color for o in task.objects if o.name == "bowl"]
        if task.max_steps != 2:
            continue
        hit = 1 / len(blocks) * bowls.count(task.goal.bowl) / len(bowls)
        expected = hit + (1 - hit) * hit  # at once, or with the second and last step
        assert task.chance_score(np.random.default_rng(0)) == pytest.approx(expected, abs=0.08)
    world.close()


@pytest.mark.parametrize(("targets", "others", "bowls", "steps"), [(2, 0, 2, 8), (2, 1, 3, 6), (1, 2, 2, 5)])
def test_chance_takes_blocks_out_again(targets: int, others: int, bowls: int, steps: int) -> None:
    """As the chain of how many targets are inside says: one of the bowls is right."""
    likely = np.eye(targets + 1)[0]
    for _ in range(steps):
        then = np.zeros(targets + 1)
        for inside, mass in enumerate(likely[:-1]):
            into = (targets - inside) / (targets + others) / bowls
            out = inside / (targets + others) * (1 - 1 / bowls)
            then[inside + 1] += mass * into
            then[inside - 1] += mass * out  # nothing where none is inside
            then[inside] += mass * (1 - into - out)
        then[-1] += likely[-1]  # reached: the episode has ended
        likely = then
    things = [SimpleNamespace(color=color) for color in ("red",) * targets + ("blue",) * others]
    task = SimpleNamespace(
        goal=ColorGoal("red", "green"),
        max_steps=steps,
        blocks=lambda: things,
        bowls=lambda: [SimpleNamespace(color="green" if number == 0 else "gray") for number in range(bowls)],
    )
    expected = float(likely @ np.arange(targets + 1)) / targets
    found = np.mean([PutBlocksInBowls.chance_score(task, np.random.default_rng(seed)) for seed in range(10)])  # type: ignore[arg-type]
    assert found == pytest.approx(expected, abs=0.025)
