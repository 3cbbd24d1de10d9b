"""What a random block into a random bowl would score: the number to state beside every mean score."""

from __future__ import annotations

import numpy as np

from sim_bridge.tasks import PutBlocksInBowls

_DRAWS = 400


def chance_score(task: PutBlocksInBowls, rng: np.random.Generator) -> float:
    """Expected score, 0..1, of an agent that never fails to move something, but chooses at random.

    Each step moves one of the blocks, wherever it lies, into one of the bowls; as in an evaluation, the
    episode ends early when the goal is reached.
    """
    is_target = np.array([block.color == task.goal.block for block in task.blocks()])
    is_goal = np.array([bowl.color == task.goal.bowl for bowl in task.bowls()])
    inside = np.zeros((_DRAWS, len(is_target)), dtype=bool)
    for _ in range(task.max_steps):
        going = ~inside[:, is_target].all(axis=1)
        block = rng.integers(len(is_target), size=_DRAWS)
        bowl = rng.integers(len(is_goal), size=_DRAWS)
        inside[going, block[going]] = is_goal[bowl[going]]
    return float(inside[:, is_target].mean())
