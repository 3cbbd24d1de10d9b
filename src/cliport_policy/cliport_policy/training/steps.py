"""Steps of a small net's training: batches made ahead, progress shown, state saved now and then, stopped on request."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from typing import NamedTuple, TypeVar

import torch

from cliport_policy.data.loader import made_ahead
from cliport_policy.training.log import ProgressLine
from cliport_policy.training.trainer import Progress

T = TypeVar("T")


class Schedule(NamedTuple):
    """First step to take, how many there are in all, samples of each, and seconds between two saves."""

    first: int
    steps: int
    samples: int
    save_seconds: float


def take_steps(
    schedule: Schedule,
    make: Callable[[int], T],
    take: Callable[[int, T], dict[str, float]],
    optimizer: torch.optim.Optimizer,
    save: Callable[[int], None],
    is_stopped: Callable[[], bool],
) -> bool:
    """Take the steps that are left; return False if it was stopped before the last, with all saved that was learned.

    make: the batch of a step's number, by a process of its own. take: its losses, by name. save: what is told how many
    steps are behind.
    """
    first, steps, samples, save_seconds = schedule
    line, began = ProgressLine(sys.stderr), time.monotonic()
    saved, left = began, range(first, steps)
    for step, batch in zip(left, made_ahead(make, left, workers=1), strict=True):
        losses, done, now = take(step, batch), step + 1, time.monotonic()
        pace = (done - first) / (now - began)
        minutes = (steps - done) / pace / 60
        line(Progress(done, steps, losses, optimizer.param_groups[0]["lr"], samples * pace, minutes))
        stopped = is_stopped()
        if stopped or now - saved >= save_seconds or done == steps:
            saved = now
            save(done)
        if stopped and done < steps:
            return False
    return True
