"""Picture of `reliability`: the done head on finished and unfinished scenes, and confidence against correctness."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

BINS = np.linspace(0.0, 1.0, 11)


def plot_reliability(
    finished: NDArray[np.float64],
    unfinished: NDArray[np.float64],
    confidence: NDArray[np.float64],
    right: NDArray[np.bool_],
    path: Path,
) -> None:
    """Draw the arrays of a `Reliability` into a file.

    Raises:
        OSError: if the file can't be written.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9, 3.6), layout="constrained")
    left, other = figure.subplots(1, 2)
    left.hist([unfinished, finished], BINS, label=["unfinished", "finished"], color=["#4e79a7", "#f28e2b"])
    left.set(xlabel="probability that nothing remains to be done", ylabel="scenes")
    left.legend()
    bins = np.clip(np.digitize(confidence, BINS) - 1, 0, len(BINS) - 2)
    used = np.unique(bins)
    other.plot([0, 1], [0, 1], color="0.7", linestyle="--", label="as sure as right")
    other.plot(
        [confidence[bins == b].mean() for b in used], [right[bins == b].mean() for b in used], "o-", color="#59a14f"
    )
    for b in used:
        other.annotate(str(int((bins == b).sum())), (confidence[bins == b].mean(), right[bins == b].mean()))
    other.set(xlabel="confidence", ylabel="share right, of so many", xlim=(0, 1.02), ylim=(0, 1.05))
    other.legend()
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=110)
