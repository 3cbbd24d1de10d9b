"""What a data set shows and what it does not: a policy learns the bias of its data (seed §D)."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from cliport_episodes.summary import EpisodeInfo
from cliport_perception.pose import PlanarPose
from cliport_perception.workspace import WorkspaceSpec

COLOR_WORDS = (
    *("red", "green", "blue", "yellow", "orange", "purple", "pink", "cyan", "brown", "gray", "grey", "white", "black"),
)
SQUARE = 0.1  # side of the squares in which positions are counted [m]
_MANY = 10  # positions, words or instructions below which nothing is said of their balance
_MOST, _FEW = 0.6, 0.1  # shares that are called most and hardly any


@dataclass(frozen=True, eq=False)
class Statistics:
    """Counts over the steps of a data set; success over its episodes.

    instructions, color_words, primitives, sources: how many steps have each, the most frequent first; a colour word
    counts once a step. picks, places: (rows, cols) how many lie in each cell of the heightmap's grid; outside: how
    many lie beside it.
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
        """`picks` or `places` summed over squares of `SQUARE`: (ceil(rows / n), ceil(cols / n)), n cells a side."""
        side = max(1, round(SQUARE / self.workspace.pixel_size))
        starts = [np.arange(0, length, side) for length in counts.shape]
        return np.add.reduceat(np.add.reduceat(counts, starts[0], axis=0), starts[1], axis=1)

    def biases(self) -> tuple[str, ...]:
        """What a policy trained on this may get wrong, each in a line for a person."""
        lines = _position_biases("pick", self.squares(self.picks))
        lines += _position_biases("place", self.squares(self.places))
        for what, counts in (("instruction", self.instructions), ("colour", self.color_words)):
            most = next(iter(counts), None)
            total = sum(counts.values())
            if most is not None and total >= _MANY and counts[most] > _MOST * total:
                share = 100 * counts[most] / total
                lines.append(f"{share:.0f} % of what is asked for has the {what} '{most}': ask for others too")
        if self.outside:
            lines.append(f"{self.outside} poses lie outside the workspace: they cannot be learned")
        return tuple(lines)

    def to_dict(self) -> dict[str, Any]:
        """Plain values, ready for JSON; positions by square."""
        values = asdict(self)
        squares = {name: self.squares(values[name]).tolist() for name in ("picks", "places")}
        return {**values, **squares, "square": SQUARE, "biases": list(self.biases())}


def count_statistics(episodes: Iterable[EpisodeInfo], workspace: WorkspaceSpec) -> Statistics:
    """Count over episodes; those without steps are left out."""
    counted = [episode for episode in episodes if episode.n_steps]
    records = [record for episode in counted for record in episode.records]
    words = (set(re.findall(r"[a-z]+", record.instruction.lower())) for record in records)
    picks, missed_picks = _grid([record.pick for record in records], workspace)
    places, missed_places = _grid([record.place for record in records], workspace)
    marks = {True: "success", False: "failure", None: "unmarked"}
    return Statistics(
        workspace=workspace,
        n_episodes=len(counted),
        n_steps=len(records),
        n_executed=sum(record.executed for record in records),
        success=_ranked(marks[episode.success] for episode in counted),
        instructions=_ranked(record.instruction for record in records),
        color_words=_ranked(word for said in words for word in COLOR_WORDS if word in said),
        primitives=_ranked(record.primitive.name.lower() for record in records),
        sources=_ranked(record.source.name.lower() for record in records),
        picks=picks,
        places=places,
        outside=missed_picks + missed_places,
    )


def _ranked(values: Iterable[str]) -> dict[str, int]:
    return dict(sorted(Counter(values).items(), key=lambda item: (-item[1], item[0])))


def _grid(poses: list[PlanarPose], workspace: WorkspaceSpec) -> tuple[npt.NDArray[np.int32], int]:
    """How many poses lie in each cell, and how many in none."""
    counts: npt.NDArray[np.int32] = np.zeros(workspace.shape, dtype=np.int32)
    inside = [pose for pose in poses if workspace.contains_xy(pose.x, pose.y)]
    for pose in inside:
        counts[workspace.xy_to_pixel(pose.x, pose.y)] += 1
    return counts, len(poses) - len(inside)


def _position_biases(what: str, squares: npt.NDArray[np.int32]) -> list[str]:
    total = int(squares.sum())
    if total < _MANY:
        return []
    lines = []
    rows, cols = squares.shape
    left, right = squares[rows - rows // 2 :].sum(), squares[: rows // 2].sum()  # rows run along +y, to the left
    far, near = squares[:, cols - cols // 2 :].sum(), squares[:, : cols // 2].sum()
    for side, count in (("left", left), ("right", right), ("far", far), ("near", near)):
        if count < _FEW * total:
            share = 100 * count / total
            lines.append(f"{share:.0f} % of the {what}s lie in the {side} half of the table: {what} there too")
    if squares.max() > _MOST * total:
        lines.append(f"{100 * squares.max() / total:.0f} % of the {what}s lie in one square of {100 * SQUARE:.0f} cm")
    return lines
