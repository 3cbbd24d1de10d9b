"""A goal of the bowl task: which blocks, into which bowls."""

from __future__ import annotations

from dataclasses import dataclass

from sim_bridge.colors import rgb
from sim_bridge.errors import GoalError

DONE_SENTENCE = "done placing blocks in bowls."
PATTERN = "put the {block} blocks in a {bowl} bowl"


@dataclass(frozen=True)
class ColorGoal:
    """Goal of two colours: the blocks of the one go into bowls of the other.

    Raises:
        GoalError: when both colours are the same.
        UnknownNameError: when the benchmark has no such colour.
    """

    block: str
    bowl: str

    def __post_init__(self) -> None:
        rgb(self.block)
        rgb(self.bowl)
        if self.block == self.bowl:
            raise GoalError(
                f"blocks and bowl are both {self.block}: the task has no block of its bowl's colour; "
                "name two different colours"
            )

    @property
    def sentence(self) -> str:
        """The benchmark's sentence for this goal."""
        return PATTERN.format(block=self.block, bowl=self.bowl)
