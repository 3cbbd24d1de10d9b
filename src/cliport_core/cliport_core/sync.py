"""Approximate time synchronisation of a few streams."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from typing import Generic, TypeVar

T = TypeVar("T")


class ApproximateSync(Generic[T]):
    """Matches items of several streams whose stamps lie within `slop_ns` of each other.

    An item is handed out once at most; whatever is older than a match is dropped. Each stream keeps its
    newest `queue` items.
    """

    def __init__(self, streams: Sequence[str], slop_ns: int, queue: int = 5) -> None:
        if slop_ns < 0 or queue < 1:
            raise ValueError(f"slop_ns must be >= 0 and queue >= 1, got {slop_ns} and {queue}")
        self._slop_ns = slop_ns
        self._queues: dict[str, deque[tuple[int, T]]] = {name: deque() for name in streams}
        self._length = queue
        self._matches = 0
        self._drops = 0

    def add(self, stream: str, stamp_ns: int, item: T) -> dict[str, T] | None:
        """Take one item; return a match that holds it (stream -> item), or None."""
        queue = self._queues[stream]
        if queue and stamp_ns < queue[-1][0]:  # time ran backwards: the clock was reset
            self.clear()
        queue.append((stamp_ns, item))
        if len(queue) > self._length:
            queue.popleft()
            self._drops += 1
        return self._match(stream, stamp_ns)

    def take_counts(self) -> tuple[int, int]:
        """Return the numbers of matches made and of items dropped since the last call."""
        counts = self._matches, self._drops
        self._matches = self._drops = 0
        return counts

    def clear(self) -> None:
        """Forget all waiting items."""
        for queue in self._queues.values():
            self._drops += len(queue)
            queue.clear()

    def _match(self, pivot: str, stamp_ns: int) -> dict[str, T] | None:
        chosen: dict[str, int] = {}
        for name, queue in self._queues.items():
            if not queue:
                return None
            nearest = min(range(len(queue)), key=lambda i: abs(queue[i][0] - stamp_ns))
            chosen[name] = len(queue) - 1 if name == pivot else nearest
        stamps = [self._queues[name][index][0] for name, index in chosen.items()]
        if max(stamps) - min(stamps) > self._slop_ns:
            return None
        match: dict[str, T] = {}
        for name, index in chosen.items():
            queue = self._queues[name]
            for _ in range(index):
                queue.popleft()
            self._drops += index
            match[name] = queue.popleft()[1]
        self._matches += 1
        return match
