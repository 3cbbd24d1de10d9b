"""Learning curves of a training, as a picture: its losses, and its agreement with held-out demonstrations."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

LOSS, AGREEMENT = "loss/", "agreement/"  # what the names of curves begin with
_LEAST_SHOWN = 0.01  # loss
_SMOOTHED = 0.05  # share of a training that a point of a smooth curve is the mean of


class Point(NamedTuple):
    """Value after a step."""

    step: int
    value: float


Curves = dict[str, list[Point]]  # by name, in the order of their steps


def read_curves(events: Path, last: int) -> Curves:
    """Return the points in TensorBoard's files of a training, up to those of a last step; none where they are gone."""
    if not events.is_dir():
        return {}
    log = EventAccumulator(str(events), size_guidance={"scalars": 0, "images": 1}).Reload()
    curves: Curves = {}
    for name in log.Tags()["scalars"]:
        points = [Point(point.step, point.value) for point in log.Scalars(name) if point.step <= last]
        if points:
            curves[name] = points
    return curves


def save_curves(curves: Curves, batch_size: int, path: Path) -> None:
    """Draw a training's losses, and its agreement where that was measured, over the samples it has seen.

    Losses that are always 0 are left out, those of networks that it lacks.

    Raises:
        OSError: if the picture can't be written.
    """
    from matplotlib.figure import Figure  # no pyplot: no display, no state

    agrees = any(name.startswith(AGREEMENT) for name in curves)
    figure = Figure(figsize=(10 if agrees else 5, 3.8), layout="constrained")
    panels = figure.subplots(1, 2 if agrees else 1, squeeze=False)[0]
    panels[0].set(ylabel="loss")
    for name, points in curves.items():
        steps, values = (np.array(each) for each in zip(*points, strict=True))
        if name.startswith(LOSS) and values.any():
            panels[0].plot(batch_size * steps, smooth(values), label=name.removeprefix(LOSS))
        elif name.startswith(AGREEMENT):
            panels[1].plot(batch_size * steps, 100 * values, "o-", label=name.removeprefix(AGREEMENT))
    panels[0].set_yscale("log")
    panels[0].set_ylim(bottom=_LEAST_SHOWN)
    if agrees:
        panels[1].set(ylabel="agrees with held-out demonstrations [%]", ylim=(0, 103))
    for panel in panels:
        panel.set(xlabel="samples")
        panel.grid(alpha=0.3)
        if panel.lines:
            panel.legend(fontsize="small")
    figure.savefig(path, dpi=110)


def smooth(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the mean of each value (N,) and its neighbours, over 5 % of all values and fewer near the ends."""
    half = int(_SMOOTHED * len(values) / 2)
    sums = np.concatenate(([0.0], np.cumsum(values)))
    first = np.maximum(np.arange(len(values)) - half, 0)
    last = np.minimum(np.arange(len(values)) + half + 1, len(values))
    return np.asarray((sums[last] - sums[first]) / (last - first))
