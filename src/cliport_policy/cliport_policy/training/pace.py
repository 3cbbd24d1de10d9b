"""Length of a training that is to take some minutes on this machine: by its measured pace."""

from __future__ import annotations

import shutil
import time
from collections.abc import Sequence
from pathlib import Path

from cliport_policy.config import RECIPES, TrainConfig
from cliport_policy.data.demonstrations import load_demonstrations
from cliport_policy.data.mixture import Source
from cliport_policy.language import shared_encoder
from cliport_policy.training.distributed import join_group
from cliport_policy.training.options import parse_options
from cliport_policy.training.trainer import Trainer

LEAST_STEPS = 40
MOST_STEPS = RECIPES["ours"].steps
_UNCOUNTED, _COUNTED = 2, 6  # first steps of a trial, which are slower, and those that are timed


def measured_pace(words: Sequence[str], scratch: Path) -> float:
    """Return the steps a second of a training with these arguments of `train`; what it learned is thrown away.

    Raises:
        PolicyError: when it cannot begin.
    """
    trial = ["--out", str(scratch), "--steps", str(_UNCOUNTED + _COUNTED), "--phrases", "1"]
    options = parse_options([*words, *trial])
    group = join_group(options.device)
    try:
        sources = [Source(load_demonstrations(entry.folder), entry.weight, entry.settings) for entry in options.data]
        trainer = Trainer(
            sources, scratch, options.network, options.train, shared_encoder(), {}, group, options.initial
        )
        ends: list[float] = []
        trainer.run(lambda _: ends.append(time.monotonic()))
        return _COUNTED / max(ends[-1] - ends[_UNCOUNTED - 1], 1e-9)
    finally:
        group.leave()
        shutil.rmtree(scratch, ignore_errors=True)


def steps_within(minutes: float, pace: float, most: int) -> int:
    """Return how many steps fit into some minutes; pace: steps a second."""
    return max(LEAST_STEPS, min(round(60 * minutes * pace), most))


def length_words(steps: int, recipe: TrainConfig) -> list[str]:
    """Return the arguments of `train` for so many steps, of which a tenth at most warm up."""
    return ["--steps", str(steps), "--set", f"train.warmup_steps={min(recipe.warmup_steps, steps // 10)}"]
