"""Signals on which a training saves and ends."""

from __future__ import annotations

import signal


def stop_on_signals() -> list[int]:
    """Return a list that SIGINT or SIGTERM appends to: training then saves and ends after the current step."""
    received: list[int] = []
    for name in (signal.SIGINT, signal.SIGTERM):
        signal.signal(name, lambda number, _frame: received.append(number))
    return received
