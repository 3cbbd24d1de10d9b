"""The policy in a thread of its own, so that a stop is heard while it thinks."""

from __future__ import annotations

import logging
import os
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from functools import partial
from typing import NamedTuple, Protocol

import torch

from cliport_core.errors import CoreError
from cliport_core.heap import trim_heap
from cliport_core.heightmap import Heightmap
from cliport_policy.errors import ConfigError, PolicyError
from cliport_policy.inference import Inference

logger = logging.getLogger(__name__)


def use_threads(count: int) -> None:
    """Let torch compute with so many threads; 0: half of the cores that the process may use, one at least.

    Threads that wait for one another lose more than they gain where the simulator, or perception, has their core.

    Raises:
        ConfigError: if the count is negative.
    """
    if count < 0:
        raise ConfigError(f"threads is {count}: give 1 or more, or 0 for half of the cores")
    torch.set_num_threads(count or max(1, len(os.sched_getaffinity(0)) // 2))


class InferringPolicy(Protocol):
    """A policy, as far as it is asked here."""

    def warm_up(self) -> None:
        """Run once on nothing: the first call is the slowest."""

    def infer(self, observation: Heightmap, instruction: str, with_maps: bool = False) -> Inference:
        """Return the next action. Raises PolicyError."""


class InferenceAnswer(NamedTuple):
    """The answer to one call: the inference and its heightmap, or one line of error."""

    token: int
    inference: Inference | None
    heightmap: Heightmap | None
    error: str


class InferenceWorker:
    """A thread that infers; `on_answer` is called in it."""

    def __init__(self, policy: InferringPolicy, on_answer: Callable[[InferenceAnswer], None]) -> None:
        self._policy = policy
        self._on_answer = on_answer
        self._pool = ThreadPoolExecutor(1, "inference")

    def use(self, policy: InferringPolicy) -> None:
        """Infer with this policy from now on."""
        self._policy = policy

    def warm_up(self) -> None:
        """Run the policy once on nothing: the first call is the slowest."""
        self.run(self._warm_up)

    def start(self, token: int, observe: Callable[[], Heightmap], instruction: str) -> None:
        """Infer on what `observe` returns; it is called in the thread, too."""
        self.run(partial(self._run, token, observe, instruction))

    def run(self, job: Callable[[], None]) -> Future[None]:
        """Run something slow after what is waiting; where it fails, a warning says so."""
        future = self._pool.submit(job)
        future.add_done_callback(_warn_of_failure)
        return future

    def close(self) -> None:
        """Drop what waits, and do not wait for what runs."""
        self._pool.shutdown(wait=False, cancel_futures=True)

    def _run(self, token: int, observe: Callable[[], Heightmap], instruction: str) -> None:
        try:
            heightmap = observe()
            inference = self._policy.infer(heightmap, instruction, with_maps=True)
            answer = InferenceAnswer(token, inference, heightmap, "")
        except (PolicyError, CoreError) as error:
            answer = InferenceAnswer(token, None, None, str(error))
        except Exception as error:  # whatever it is, the server must hear of it and say so in one line
            logger.debug("inference failed", exc_info=True)
            reason = " ".join(str(error).split())[:200]
            answer = InferenceAnswer(token, None, None, f"inference failed: {type(error).__name__}: {reason}")
        self._on_answer(answer)
        trim_heap()

    def _warm_up(self) -> None:
        self._policy.warm_up()
        trim_heap()


def _warn_of_failure(future: Future[None]) -> None:
    error = None if future.cancelled() else future.exception()
    if error is not None:
        reason = " ".join(str(error).split())[:200]
        logger.warning("the inference thread failed: %s: %s", type(error).__name__, reason)
