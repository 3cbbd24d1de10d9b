"""place-red-in-green: the bowl task with one goal (task specification, section 8)."""

from __future__ import annotations

import numpy as np

from sim_bridge.colors import COLORS
from sim_bridge.task_mechanics.base import Split
from sim_bridge.tasks.color_goal import ColorGoal
from sim_bridge.tasks.put_blocks_in_bowls import N_DISTRACTORS, PutBlocksInBowls
from sim_bridge.tasks.variants import Variant


class PlaceRedInGreen(PutBlocksInBowls):
    """Red blocks, green bowls; distractors of any colour but these, where a red bowl or a green block is one too."""

    def __init__(self, name: str, split: Split) -> None:
        super().__init__(name, split, Variant.FULL, ColorGoal("red", "green"))

    def distractor_colors(self, rng: np.random.Generator) -> list[tuple[str, str]]:
        """Blocks of any colour but red, bowls of any but green."""
        blocks = rng.choice([c for c in COLORS if c != "red"], N_DISTRACTORS)
        bowls = rng.choice([c for c in COLORS if c != "green"], N_DISTRACTORS)
        return [(str(block), str(bowl)) for block, bowl in zip(blocks, bowls, strict=True)]

    @property
    def max_steps(self) -> int:
        """As in the benchmark."""
        return 10
