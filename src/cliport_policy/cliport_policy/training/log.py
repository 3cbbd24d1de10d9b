"""Display of a training: one line of progress, and TensorBoard's curves and affordance pictures."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from pathlib import Path
from typing import TextIO

import numpy as np
from numpy.typing import NDArray
from torch.utils.tensorboard import SummaryWriter

from cliport_policy.data.mixture import Drawn
from cliport_policy.errors import TrainingError
from cliport_policy.overlays import render_overlay
from cliport_policy.policy import Policy
from cliport_policy.training.agreement import Agreement
from cliport_policy.training.curves import AGREEMENT, LOSS, Curves, Point, read_curves
from cliport_policy.training.trainer import Progress

_SMOOTHING = 0.98
_BAR = 24  # characters
_REFRESH = 0.5  # s between refreshes on a terminal
_LINE_PERIOD, _LINE_SHARE = 5.0, 0.02  # between lines elsewhere: so many seconds, and this share of the run so far
_SCALAR_STEPS = 10


class ProgressLine:
    """Bar with losses, pace and time left: one line that changes on a terminal, a line now and then elsewhere.

    clock: steady time [s].
    """

    def __init__(self, out: TextIO, clock: Callable[[], float] = time.monotonic) -> None:
        self._out, self._clock, self._means = out, clock, dict[str, float]()
        self._began = clock()
        self._shown = -math.inf

    def __call__(self, progress: Progress) -> None:
        """Show a step."""
        for name, value in progress.losses.items():
            self._means[name] = _SMOOTHING * self._means.get(name, value) + (1 - _SMOOTHING) * value
        now, last = self._clock(), progress.step == progress.steps
        changes = self._out.isatty()
        period = _REFRESH if changes else max(_LINE_PERIOD, _LINE_SHARE * (now - self._began))
        if not last and now - self._shown <= period:
            return
        self._shown = now
        if changes:
            print(f"\r{self.line(progress)}\x1b[K", end="\n" if last else "", file=self._out, flush=True)
        else:
            print(self.line(progress), file=self._out, flush=True)

    def line(self, progress: Progress) -> str:
        """Return `[####----] 500/6000  locator 2.31  ...  31 samples/s  24 min left`."""
        filled = _BAR * progress.step // progress.steps
        losses = "  ".join(f"{name} {value:.3f}" for name, value in self._means.items())
        return (
            f"[{'#' * filled}{'-' * (_BAR - filled)}] {progress.step}/{progress.steps}  {losses}  "
            f"{progress.samples_per_s:.1f} samples/s  {progress.minutes_left:.0f} min left"
        )


class EventLog:
    """Writer of TensorBoard's event files.

    curves: all that was logged, also before this start.
    """

    def __init__(self, folder: Path, step: int) -> None:
        """Begin to log, or go on after a step; what was logged of later steps is discarded."""
        self.curves: Curves = read_curves(folder, step) if step else {}
        try:
            self._writer = SummaryWriter(str(folder), purge_step=step + 1)
        except OSError as error:
            raise TrainingError(f"can't write to {folder} ({error}): give another --out") from error

    def __call__(self, progress: Progress) -> None:
        """Log every tenth step, and the last."""
        if progress.step % _SCALAR_STEPS and progress.step != progress.steps:
            return
        for name, value in progress.losses.items():
            self._add(f"{LOSS}{name}", progress.step, value)
        self._add("learning_rate", progress.step, progress.learning_rate)
        self._add("samples_per_s", progress.step, progress.samples_per_s)

    def agreement(self, found: Agreement, step: int) -> None:
        """Log a network's agreement with held-out demonstrations."""
        for name, share in found.shares().items():
            self._add(f"{AGREEMENT}{name}", step, share)

    def is_compared(self, step: int) -> bool:
        """Return True if agreement was measured after a step."""
        return any(name.startswith(AGREEMENT) and points[-1].step == step for name, points in self.curves.items())

    def _add(self, name: str, step: int, value: float) -> None:
        self._writer.add_scalar(name, value, step)
        self.curves.setdefault(name, []).append(Point(step, value))

    def picture(self, name: str, picture: NDArray[np.uint8], step: int) -> None:
        """Log a picture, (H, W, 3) RGB."""
        self._writer.add_image(name, picture, step, dataformats="HWC")
        self._writer.flush()

    def close(self) -> None:
        """Write out and close the files."""
        self._writer.close()


def affordance_picture(policy: Policy, drawn: Drawn) -> NDArray[np.uint8]:
    """Draw a policy's pick affordance above its place affordance in a demonstration: (H, W, 3) RGB."""
    observation = drawn.data.observation(drawn.frame)
    goal = drawn.data.observation(drawn.goal) if drawn.goal else None
    inference = policy.infer(observation, drawn.demo.instruction, with_maps=True, goal=goal)
    maps = {"pick": inference.maps.pick, "place": inference.maps.place} if inference.maps else {}
    return np.concatenate([render_overlay(observation, maps.get(kind), inference, kind) for kind in ("pick", "place")])
