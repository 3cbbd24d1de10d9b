"""The newest of a stream of pictures, decoded when somebody asks for it, once."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

Rgb = npt.NDArray[np.uint8]


class Picture(NamedTuple):
    """sequence: counted from 1; stamp_ns: when it was taken [ns, ROS time]; pixels: (H, W, 3) uint8 RGB."""

    sequence: int
    stamp_ns: int
    pixels: Rgb


class PictureFeed:
    """Keeps one picture; older ones are forgotten, looked at or not. Safe between threads."""

    def __init__(self) -> None:
        self._arrived = threading.Condition()
        self._decoding = threading.Lock()
        self._sequence, self._stamp_ns = 0, 0
        self._read: Callable[[], Rgb] | None = None
        self._decoded: Picture | None = None

    def put(self, stamp_ns: int, read: Callable[[], Rgb]) -> None:
        """A new picture; `read` gives its pixels and may raise."""
        with self._arrived:
            self._sequence += 1
            self._stamp_ns, self._read = stamp_ns, read
            self._arrived.notify_all()

    def get(self, after: int, timeout: float) -> Picture | None:
        """The newest one with a sequence number greater than `after`, waiting up to `timeout` seconds for it.

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
