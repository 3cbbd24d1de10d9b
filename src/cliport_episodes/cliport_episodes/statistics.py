"""Statistics that show the bias of a data set, which a policy learns (paper, appendix I)."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from cliport_core.pose import PlanarPose
from cliport_core.workspace import WorkspaceSpec
from cliport_episodes.edits import verdict_words
from cliport_episodes.summary import EpisodeInfo

COLOR_WORDS = (
    "red",
    "green",
    "blue",
    "yellow",
    "orange",
    "purple",
    "pink",
    "cyan",
    "brown",
    "gray",
    "grey",
    "white",
    "black",
)
SQUARE = 0.1  # side of the squares in which positions are counted [m]
_MIN_COUNT = 10  # of positions, words or instructions, for a statement about their balance
_DOMINANT_SHARE = 0.6  # a larger share of one value is a bias
_RARE_SHARE = 0.1  # a smaller share of one half of the table is a bias


@dataclass(frozen=True, eq=False)
class Statistics:
    """Counts over the steps of a data set; success over its episodes.

    instructions, color_words, primitives, sources: the number of steps with each, the most frequent first; a colour
    word counts once a step. picks, places: (rows, cols) the number in each cell of the heightmap's grid; outside: the
    number beside it.
    """

    workspace: WorkspaceSpec
    n_episodes: int
    n_steps: int
    n_executed: int
    success: dict[str, int]
    instructions: dict[str, int]
    color_words: dict[str, int]
    primitives: dict[str, int]
    sources: dict[str, int]
    picks: npt.NDArray[np.int32]
    places: npt.NDArray[np.int32]
    outside: int

    def squares(self, counts: npt.NDArray[np.int32]) -> npt.NDArray[np.int32]:
        """Return `picks` or `places` summed over squares of n x n cells, `SQUARE` wide (ceil(rows/n), ceil(cols/n))."""
        side = max(1, round(SQUARE / self.workspace.pixel_size))
        starts = [np.arange(0, length, side) for length in counts.shape]
        return np.add.reduceat(np.add.reduceat(counts, starts[0], axis=0), starts[1], axis=1)

    def biases(self) -> tuple[str, ...]:
        """Return a line for a person about each bias that a policy trained on this data would learn."""
        lines = _position_biases("pick", self.squares(self.picks))
        lines += _position_biases("place", self.squares(self.places))
        for what, counts in (("instruction", self.instructions), ("colour", self.color_words)):
            most = next(iter(counts), None)
            total = sum(counts.values())
            if most is not None and total >= _MIN_COUNT and counts[most] > _DOMINANT_SHARE * total:
                share = 100 * counts[most] / total
                lines.append(f"{share:.0f} % of what is asked for has the {what} '{most}': ask for others too")
        if self.outside:
            lines.append(f"{self.outside} poses lie outside the workspace: they cannot be learned")
        return tuple(lines)

    def to_dict(self) -> dict[str, Any]:
        """Return plain values, ready for JSON; positions by square."""
        values = asdict(self)
        squares = {name: self.squares(values[name]).tolist() for name in ("picks", "places")}
        return {**values, **squares, "square": SQUARE, "biases": list(self.biases())}


def count_statistics(episodes: Iterable[EpisodeInfo], workspace: WorkspaceSpec) -> Statistics:
    """Count over the steps of episodes; episodes without steps are left out."""
    counted = [episode for episode in episodes if episode.n_steps]
    records = [record for episode in counted for record in episode.records]
    color_words: list[str] = []
    for record in records:
        words = set(re.findall(r"[a-z]+", record.instruction.lower()))
        color_words += [word for word in COLOR_WORDS if word in words]
    picks, missed_picks = _grid([record.action.pick for record in records], workspace)
    places, missed_places = _grid([record.action.place for record in records], workspace)
    return Statistics(
        workspace=workspace,
        n_episodes=len(counted),
        n_steps=len(records),
        n_executed=sum(record.result is not None for record in records),
        success=_ranked(verdict_words(episode.success) for episode in counted),
        instructions=_ranked(record.instruction for record in records),
        color_words=_ranked(color_words),
        primitives=_ranked(record.action.primitive.label for record in records),
        sources=_ranked(record.source.name.lower() for record in records),
        picks=picks,
        places=places,
        outside=missed_picks + missed_places,
    )


def _ranked(values: Iterable[str]) -> dict[str, int]:
    return dict(sorted(Counter(values).items(), key=lambda item: (-item[1], item[0])))


def _grid(poses: list[PlanarPose], workspace: WorkspaceSpec) -> tuple[npt.NDArray[np.int32], int]:
    """Return the number of poses in each cell, and the number in none."""
    counts: npt.NDArray[np.int32] = np.zeros(workspace.shape, dtype=np.int32)
    inside = [pose for pose in poses if workspace.contains_xy(pose.x, pose.y)]
    for pose in inside:
        counts[workspace.xy_to_pixel(pose.x, pose.y)] += 1
    return counts, len(poses) - len(inside)


def _position_biases(what: str, squares: npt.NDArray[np.int32]) -> list[str]:
    total = int(squares.sum())
    if total < _MIN_COUNT:
        return []
    lines = []
    rows, cols = squares.shape
    left, right = squares[rows - rows // 2 :].sum(), squares[: rows // 2].sum()  # rows run along +y, to the left
    far, near = squares[:, cols - cols // 2 :].sum(), squares[:, : cols // 2].sum()
    for side, count in (("left", left), ("right", right), ("far", far), ("near", near)):
        if count < _RARE_SHARE * total:
            share = 100 * count / total
            lines.append(f"{share:.0f} % of the {what}s lie in the {side} half of the table: {what} there too")
    if squares.max() > _DOMINANT_SHARE * total:
        lines.append(f"{100 * squares.max() / total:.0f} % of the {what}s lie in one square of {100 * SQUARE:.0f} cm")
    return lines
