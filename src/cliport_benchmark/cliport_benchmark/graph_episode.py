"""A whole episode through the graph: every sentence of the task in its turn, up to the task's own number of actions."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import NamedTuple, Protocol

from cliport_benchmark.errors import BenchmarkError
from cliport_interfaces.msg import PolicyStatus

_POLL_S = 0.25  # between looks at what the simulator asks for
ENDED = (PolicyStatus.STATE_DONE, PolicyStatus.STATE_FAILED)
EPISODE_TIMEOUT = 900.0  # of an episode [s]: twenty actions and more
# Words of the server after which nobody tries again: the arm was stopped, or may still move.
_STOPPED = ("executor: CANCELLED", "look before you go on", "look, then call")


class Progress(NamedTuple):
    """Present state of the simulator's scene: score 0..1, whether the task is reached, the present sentence, and
    whether things flew apart, after which the score stays."""

    score: float
    done: bool
    instruction: str
    broken: bool = False


class Graph(Protocol):
    """The running graph, as far as an episode needs it."""

    def instruct(self, text: str) -> None:
        """Publish an instruction."""

    def newest_status(self) -> PolicyStatus | None:
        """Return the last status since the instruction."""

    def progress(self) -> Progress:
        """Return what the simulator says now."""

    def simulated_time(self) -> float:
        """Return the simulator's time [s]."""


class Played(NamedTuple):
    """Result of an episode. sentences: what was said, in order. steps: actions that were begun in all."""

    score: float
    steps: int
    message: str
    sentences: tuple[str, ...]
    ended_well: bool


def play_episode(
    graph: Graph,
    first: str,
    max_steps: int,
    timeout: float,
    alive: Callable[[], bool] = lambda: True,
    settle: float = 0.0,
    sleep: Callable[[float], None] = time.sleep,
    now: Callable[[], float] = time.monotonic,
) -> Played:
    """Run an episode: each sentence follows when the one before is reached.

    It ends when the task is reached, the policy gives up, things fly apart or the steps are spent.

    first: the scene's first sentence. timeout: of the whole episode [s]. alive: whether the graph runs. settle: how
    long after a motion the simulator may need to judge it [s of simulated time].

    Raises:
        BenchmarkError: when the graph ended, or somebody stopped the policy.
    """
    said, sentences, before, message = first, [first], 0, ""
    graph.instruct(first)
    deadline, steps, ended_well, ends = now() + timeout, 0, False, _Ends(settle, graph.simulated_time)
    while now() < deadline:
        sleep(_POLL_S)
        status, progress = _look(graph, said, alive)
        if status is not None:
            steps, message = before + int(status.step), status.message
        resting = status is not None and status.state != PolicyStatus.STATE_EXECUTING
        if progress.done and resting:  # while the arm moves, what it carries may only pass by
            graph.instruct("")  # a policy that does not see that it is done would go on
            return Played(progress.score, steps, message, tuple(sentences), True)
        if progress.broken:
            break
        over = ends.is_over(status)
        if progress.instruction != said and not progress.done:  # what a task says at its end asks for nothing
            said, before = progress.instruction, steps
            sentences.append(said)
            graph.instruct(said)
        elif over and (steps >= max_steps or not _goes_on(message)):
            ended_well = status is not None and status.state == PolicyStatus.STATE_DONE
            break
        elif over:
            before = steps
            graph.instruct(said)
        elif steps > max_steps:
            break
    graph.instruct("")
    return Played(graph.progress().score, min(steps, max_steps), message, tuple(sentences), ended_well)


class _Ends:
    """Tells when the policy's end of a sentence stands: what it did is first judged, as another sentence may follow."""

    def __init__(self, settle: float, now: Callable[[], float]) -> None:
        self._settle, self._now = settle, now
        self._judged_by = 0.0

    def is_over(self, status: PolicyStatus | None) -> bool:
        """Take the status of a look; return True at its end."""
        over = status is not None and status.state in ENDED
        if status is not None and over and not _goes_on(status.message):
            return self._now() >= self._judged_by
        self._judged_by = self._now() + self._settle
        return over


def _goes_on(message: str) -> bool:
    """Return True where the server only wants to be asked again: a motion that failed has cost a step."""
    failed = message.startswith("executor: ") and not any(words in message for words in _STOPPED)
    return failed or message.startswith("step limit of ")


def _look(graph: Graph, said: str, alive: Callable[[], bool]) -> tuple[PolicyStatus | None, Progress]:
    """Return the newest status of the sentence that was said, None for none, and what the simulator says."""
    if not alive():
        raise BenchmarkError("the graph ended before the episode did")
    status, progress = graph.newest_status(), graph.progress()
    if status is None or status.instruction != said:
        return None, progress
    check_not_stopped(status)
    return status, progress


def check_not_stopped(status: PolicyStatus) -> None:
    """Check the status of a sentence that was said. Raises BenchmarkError where somebody stopped the policy."""
    if status.state == PolicyStatus.STATE_IDLE:
        raise BenchmarkError(f"somebody stopped the policy: {status.message}")
