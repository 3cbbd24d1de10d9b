"""Newest picture of a stream, decoded once, when somebody asks for it."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

Rgb = npt.NDArray[np.uint8]


class Picture(NamedTuple):
    """A picture of a stream; sequence: from 1; stamp_ns: when it was taken [ns, ROS time]; pixels: (H, W, 3) RGB."""

    sequence: int
    stamp_ns: int
    pixels: Rgb


class PictureFeed:
    """Newest picture of a stream; older ones are dropped, seen or not. Safe between threads."""

    def __init__(self) -> None:
        self._arrived = threading.Condition()
        self._decoding = threading.Lock()
        self._sequence, self._stamp_ns = 0, 0
        self._read: Callable[[], Rgb] | None = None
        self._decoded: Picture | None = None

    def put(self, stamp_ns: int, read: Callable[[], Rgb]) -> None:
        """Store a new picture; `read` decodes its pixels and may raise."""
        with self._arrived:
            self._sequence += 1
            self._stamp_ns, self._read = stamp_ns, read
            self._arrived.notify_all()

    def get(self, after: int, timeout: float) -> Picture | None:
        """Return the newest picture if its sequence number exceeds `after`, waiting up to `timeout` seconds; else None.

        A sequence number from the future (the station was restarted) counts as 0.
        """
        with self._arrived:
            after = after if after <= self._sequence else 0
            if not self._arrived.wait_for(lambda: self._sequence > after, timeout) or self._read is None:
                return None
            sequence, stamp_ns, read = self._sequence, self._stamp_ns, self._read
        with self._decoding:  # of several who ask at once, one decodes
            if self._decoded is None or self._decoded.sequence < sequence:
                self._decoded = Picture(sequence, stamp_ns, read())
            return self._decoded
