"""place-red-in-green: the bowl task with one goal.

See docs/benchmark.md, "place-red-in-green".
"""

from __future__ import annotations

import numpy as np

from sim_bridge.colors import COLORS
from sim_bridge.task_mechanics.task import Split, Task
from sim_bridge.tasks.color_goal import ColorGoal
from sim_bridge.tasks.put_blocks_in_bowls import N_DISTRACTORS, PutBlocksInBowls
from sim_bridge.tasks.variants import Variant


class PlaceRedInGreen(PutBlocksInBowls):
    """Task with red blocks and green bowls; distractors have any colour but
    these, and may be a red bowl or a green block."""

    def __init__(self, name: str, split: Split) -> None:
        super().__init__(name, split, Variant.FULL, ColorGoal("red", "green"))

    def ask_for(self, instruction: str) -> None:
        """Refuse every sentence: this task has one goal."""
        Task.ask_for(self, instruction)

    def distractor_colors(self, rng: np.random.Generator) -> list[tuple[str, str]]:
        """Return the k-th colours for the k-th distractor: a block without red, a bowl without green."""
        blocks = [color for color in COLORS if color != "red"]
        bowls = [color for color in COLORS if color != "green"]
        return list(zip(blocks, bowls, strict=True))[:N_DISTRACTORS]

    @property
    def max_steps(self) -> int:
        """Ten, as in the benchmark."""
        return 10
