"""packing-box-pairs: fill the brown box with all boxes of one or two colours.

See docs/benchmark.md, "packing-box-pairs".
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sim_bridge.errors import LayoutError
from sim_bridge.task_mechanics.task import Split
from sim_bridge.tasks.box_partition import Cell
from sim_bridge.tasks.packing_boxes import PackingBoxes, add_box
from sim_bridge.tasks.variants import Variant
from sim_bridge.world import SimWorld

N_DISTRACTORS = 4


class PackingBoxPairs(PackingBoxes):
    """Variant in which boxes of the named colours fill the container; up to
    four of other colours and the same sizes stay."""

    sentence_pattern = "pack all the {first} and {second} blocks into the brown box"
    done_sentence = "done packing blocks."
    z_cap = 0.0525  # no piles

    def __init__(self, name: str, split: Split, variant: Variant) -> None:
        super().__init__(name, split)
        self.palette = variant.palette(split)
        self._colors: tuple[str, ...] = ()

    @property
    def sentence(self) -> str:
        """Sentence with the scene's one or two colours."""
        return f"pack all the {' and '.join(self._colors)} blocks into the brown box"

    def draw_colors(self, count: int, rng: np.random.Generator) -> list[str]:
        """Draw one of two colours for each box, so that one of them may be absent; a lone box has the only one."""
        drawn = rng.permutation(len(self.palette))[: min(2, count)]
        self._colors = tuple(self.palette[i] for i in drawn)
        return [self._colors[i] for i in rng.integers(len(self._colors), size=count)]

    def add_distractors(self, world: SimWorld, cells: Sequence[Cell], rng: np.random.Generator) -> None:
        """Add boxes as large as some of those to pack, in the palette's other colours, as many as find a place."""
        others = [color for color in self.palette if color not in self._colors]
        for _ in range(N_DISTRACTORS):
            cell, color = cells[int(rng.integers(len(cells)))], others[int(rng.integers(len(others)))]
            try:
                add_box(world, cell, color, rng)
            except LayoutError:
                continue
