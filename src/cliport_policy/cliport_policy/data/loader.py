"""Batches made ahead by background processes: shuffled, the same at every run, and cut up for several trainings."""

from __future__ import annotations

import itertools
import os
import time
from collections.abc import Callable, Generator, Iterable, Iterator
from contextlib import contextmanager
from typing import Generic, NamedTuple, TypeVar

import cv2
import numpy as np
from numpy.typing import NDArray
from torch.utils.data import DataLoader, Dataset

from cliport_policy.config import TrainConfig
from cliport_policy.data.absences import Absences
from cliport_policy.data.batches import Batch, Phrasebook, collate, make_sample
from cliport_policy.data.mixture import Drawn, Mixture
from cliport_policy.data.recolor import Recoloring
from cliport_policy.errors import DataError, TrainingError

T = TypeVar("T")

WORKERS = min(8, len(os.sched_getaffinity(0)))  # of one process that trains
_HEARD_WITHIN = 5.0  # s, from a worker's end to the signal that tells of it


class StepBatches(NamedTuple):
    """Share of one process in one step.

    samples, actions: numbers of the whole step in all processes together.
    """

    parts: list[Batch]
    samples: int
    actions: int


class Loader:
    """Endless steps of a mixture.

    Step i is the same whenever and in whichever process it is drawn, so training can resume.
    """

    def __init__(
        self,
        mixture: Mixture,
        phrasebook: Phrasebook,
        config: TrainConfig,
        recoloring: Recoloring | None = None,
        rank: int = 0,
        world_size: int = 1,
    ) -> None:
        """Prepare to make share `rank` of the `world_size` equal shares of each step."""
        self._mixture, self._phrasebook, self._recoloring, self._config = mixture, phrasebook, recoloring, config
        self._rank, self._world_size = rank, world_size
        self._absences = Absences(mixture) if config.absent_share else None

    def steps(self, first: int, workers: int = WORKERS) -> Generator[StepBatches]:
        """Yield steps from `first` on, made ahead by processes: threads would keep the one that trains waiting.

        Without workers each is made on demand, which is quicker if the training itself uses all cores.

        Raises:
            DataError: if an observation can't be read.
            RuntimeError: if a worker is gone; torch raises it wherever the training is: see `lost_workers_told`.
        """
        if not workers:
            yield from map(self.step, itertools.count(first))
            return
        yield from made_ahead(self.step, itertools.count(first), workers)

    def step(self, number: int) -> StepBatches:
        """Return this process's share of a step, in as many parts as gradients are accumulated over."""
        config = self._config
        chosen = self._mixture.draw(config.batch_size, np.random.default_rng((config.seed, number)))
        parts = np.array_split(np.arange(config.batch_size), self._world_size * config.accumulate)
        mine = parts[self._rank * config.accumulate : (self._rank + 1) * config.accumulate]
        drawn = [self._draw(int(index), number, position) for position, index in enumerate(chosen)]
        actions = sum(one.demo.acts for one in drawn)
        return StepBatches([self._batch(drawn, number, part) for part in mine if len(part)], config.batch_size, actions)

    def _draw(self, index: int, number: int, position: int) -> Drawn:
        """Return a demonstration of the mixture, or its scene under a sentence about what is not in it."""
        drawn = self._mixture[index]
        if self._absences is None:
            return drawn
        rng = np.random.default_rng((self._config.seed, number, position, 1))
        return self._absences.draw(drawn, rng) if rng.random() < self._config.absent_share else drawn

    def _batch(self, drawn: list[Drawn], number: int, part: NDArray[np.intp]) -> Batch:
        samples = []
        for position in part:
            rng = np.random.default_rng((self._config.seed, number, int(position)))
            samples.append(make_sample(drawn[position], self._phrasebook, self._recoloring, self._config, rng))
        return collate(samples)


def made_ahead(make: Callable[[int], T], numbers: Iterable[int], workers: int) -> Generator[T]:
    """Yield what is made of numbers, in their order, by processes beside the one that asks.

    Raises:
        DataError: as `make` raises it.
        RuntimeError: if a worker is gone; see `lost_workers_told`.
    """
    ahead = DataLoader(
        _Ahead(make),
        batch_size=None,
        sampler=numbers,
        num_workers=workers,
        collate_fn=_as_it_is,
        multiprocessing_context="fork",
    )
    threads = cv2.getNumThreads()
    cv2.setNumThreads(1)  # before the workers begin, which share the cores: told later, one with a pool would hang
    try:
        for made in _as_torch_tells(iter(ahead)):
            if isinstance(made, DataError):
                raise made
            yield made
    finally:
        cv2.setNumThreads(threads)


@contextmanager
def lost_workers_told() -> Iterator[None]:
    """Report in one line, as a TrainingError, that a process which made batches is gone."""
    try:
        yield
    except RuntimeError as error:
        if "DataLoader worker (pid" not in str(error):  # not one's own error, which is handed on from there
            raise
        raise TrainingError(
            "a process that makes batches is gone, for want of memory or of room in /dev/shm, say: see to that and run "
            "the same command again"
        ) from error


class _Ahead(Dataset["T | DataError"], Generic[T]):
    """Things as processes make them; an error is handed on as it is, in one line."""

    def __init__(self, make: Callable[[int], T]) -> None:
        self._make = make

    def __getitem__(self, number: int) -> T | DataError:
        try:
            return self._make(number)
        except DataError as error:
            return error


def _as_torch_tells(made: Iterator[T | DataError]) -> Iterator[T | DataError]:
    """Yield what is made; where a worker's end cuts a batch off, wait for torch's word of it, which says what it is.

    Torch hears of it by a signal a moment later, and raises then, wherever the training is.
    """
    try:
        yield from made
    except (OSError, EOFError):
        time.sleep(_HEARD_WITHIN)
        raise


def _as_it_is(made: T) -> T:
    return made
