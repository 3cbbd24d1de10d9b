"""Data sets mixed by weight: the choice of demonstrations that a training draws, and how often.

The paper's mixtures are weights (docs/paper.md, "Mixtures of tasks"). Multi: one data set a task, all of weight 1.
Multi-attr, with a held-out task X of which only the seen split is given: X at the sum of the others' weights, so that
every other sample is X's; each of the others' `full` splits at 1. An episode is drawn with its own task, so n
demonstrations of each task are n, which the published code's shared index list made up to ten times as many.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cliport_core.workspace import WorkspaceSpec
from cliport_policy.data.demonstrations import Demonstration, DemonstrationSet, Frame, Index
from cliport_policy.errors import DataError


@dataclass(frozen=True)
class SourceSettings:
    """Switches of what a training may do to a data set's scenes and sentences, where it does that at all.

    recolor: False for things that are known by their own colours. rearrange: False for things that may not lie
    anywhere. paraphrase: False leaves its sentences as they are.
    """

    recolor: bool = True
    rearrange: bool = True
    paraphrase: bool = True


@dataclass(frozen=True)
class Source:
    """Data set, its weight relative to the others', and what may be done to its scenes."""

    data: DemonstrationSet
    weight: float = 1.0
    settings: SourceSettings = SourceSettings()

    def __post_init__(self) -> None:
        if not (math.isfinite(self.weight) and self.weight > 0):
            raise DataError(f"the weight of {self.data.folder} is {self.weight}: give a positive number, as in DIR:2")


class Drawn(NamedTuple):
    """One demonstration of a mixture.

    goal: the frame that shows the finished scene, if it was asked for and is known.
    """

    data: DemonstrationSet
    frame: Frame
    demo: Demonstration
    goal: Frame | None
    settings: SourceSettings = SourceSettings()


class Mixture:
    """Demonstrations of several data sets in one workspace.

    A data set is drawn by its weight, in it a finished scene with probability done_share (if it has both kinds),
    and of these any one demonstration is as likely as another. With goals, only demonstrations with an image of the
    finished scene are drawn, together with it.
    """

    def __init__(self, sources: Sequence[Source], done_share: float = 0.15, with_goals: bool = False) -> None:
        """Index the demonstrations.

        Raises:
            DataError: if workspaces differ, or a data set has nothing to draw.
        """
        self.sources = list(sources)
        _check_workspaces([source.data for source in self.sources])
        self._goals = [source.data.goal_frames() if with_goals else None for source in self.sources]
        self._samples: list[tuple[int, Index]] = []
        weights = []
        for number, source in enumerate(self.sources):
            samples = self._drawable_samples(number)
            weights.append(source.weight * _probabilities(source.data, samples, done_share))
            self._samples += [(number, sample) for sample in samples]
        self._cumulative = np.cumsum(np.concatenate(weights))

    @property
    def workspace(self) -> WorkspaceSpec:
        """Workspace of all data sets."""
        return self.sources[0].data.workspace

    def __len__(self) -> int:
        return len(self._samples)

    def __getitem__(self, index: int) -> Drawn:
        number, (frame, demo) = self._samples[index]
        data, goals = self.sources[number].data, self._goals[number]
        goal = None if goals is None else data.frames[goals[frame]]
        return Drawn(data, data.frames[frame], data.frames[frame].demos[demo], goal, self.sources[number].settings)

    def draw(self, count: int, rng: np.random.Generator) -> NDArray[np.intp]:
        """Draw indices of `count` demonstrations, with replacement."""
        return np.searchsorted(self._cumulative, rng.random(count) * self._cumulative[-1], side="right")

    def instructions(self) -> list[str]:
        """Return each sentence once, sorted."""
        return sorted({self.sources[i].data.demo(sample).instruction for i, sample in self._samples})

    def instructions_by_source(self) -> list[set[str]]:
        """Return each source's sentences, in the sources' order."""
        found: list[set[str]] = [set() for _ in self.sources]
        for i, sample in self._samples:
            found[i].add(self.sources[i].data.demo(sample).instruction)
        return found

    def _drawable_samples(self, number: int) -> list[Index]:
        data, goals = self.sources[number].data, self._goals[number]
        if goals is None:
            return data.samples()
        samples = [Index(frame, 0) for frame in sorted(goals)]
        if not samples:
            raise DataError(
                f"{data.folder} has no observation of a finished scene, which an image-goal network needs: "
                "generate it again with this version"
            )
        return samples


def _check_workspaces(sets: Sequence[DemonstrationSet]) -> None:
    for other in sets[1:]:
        check_same_workspace(sets[0], other)


def check_same_workspace(a: DemonstrationSet, b: DemonstrationSet) -> None:
    """Raise DataError, naming what differs, if two data sets were not made in one workspace."""
    mine, theirs = a.workspace.to_dict(), b.workspace.to_dict()
    differing = [f"{name} {mine[name]} and {theirs[name]}" for name in mine if mine[name] != theirs[name]]
    if differing:
        raise DataError(
            f"{a.folder} and {b.folder} were made in other workspaces ({', '.join(differing)}): generate one again"
        )


def _probabilities(data: DemonstrationSet, samples: Sequence[Index], done_share: float) -> NDArray[np.float64]:
    """Return each sample's probability; they sum to 1."""
    done = np.array([data.demo(sample).done for sample in samples])
    if done_share == 0 and done.all():
        raise DataError(f"{data.folder} shows no action: generate it again")
    share = done_share if not done.all() else 1.0
    share = share if done.any() else 0.0
    return np.where(done, share / max(done.sum(), 1), (1 - share) / max((~done).sum(), 1))
