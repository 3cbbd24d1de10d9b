"""A bound on how long a connection may take, whatever libfranka waits for."""

from __future__ import annotations

import queue
import threading
from collections.abc import Callable
from typing import TypeVar

from panda_driver.errors import ConnectionFailedError

T = TypeVar("T")


def connected_within(seconds: float, what: str, address: str, connect: Callable[[], T]) -> T:
    """Return what `connect` returns, called in a thread of its own.

    Raises:
        ConnectionFailedError: when it takes longer: an arm that serves another client accepts a second one's
            connection and never answers it.
    """
    answer: queue.Queue[tuple[T | None, Exception | None]] = queue.Queue()

    def run() -> None:
        try:
            answer.put((connect(), None))
        except Exception as error:
            answer.put((None, error))

    threading.Thread(target=run, name=f"connect {what}", daemon=True).start()
    try:
        made, error = answer.get(timeout=seconds)
    except queue.Empty:
        raise ConnectionFailedError(
            f"no answer from the {what} at {address} for {seconds:g} s: another program may be connected to it, end "
            "it; else look at the address, and that FCI is active in Desk"
        ) from None
    if error is not None:
        raise error
    assert made is not None
    return made
