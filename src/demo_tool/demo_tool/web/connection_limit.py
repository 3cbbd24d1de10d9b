"""Limit of connections: clients without permission must not keep out those that have it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable

PENDING_PER_ADDRESS = 16
MAX_PENDING = 64
MAX_ADMITTED = 96

Client = tuple[str, int]  # address and port: one connection


class ConnectionLimit:
    """Limit of connections: of too many, the oldest is closed, so that a new one is always served.

    A connection is pending until the guard lets one of its requests in, and admitted after that; each kind has its own
    limit. Not for several threads at once. `close` functions close a connection at once.
    """

    def __init__(self) -> None:
        self._pending: dict[Client, Callable[[], None]] = {}
        self._admitted: dict[Client, Callable[[], None]] = {}

    def add(self, client: Client, close: Callable[[], None]) -> None:
        """Count a new connection."""
        self._pending[client] = close
        by_address = Counter(address for address, _ in self._pending)
        if by_address[client[0]] > PENDING_PER_ADDRESS:
            self._close_pending(client[0])
        elif len(self._pending) > MAX_PENDING:
            self._close_pending(by_address.most_common(1)[0][0])

    def admit(self, client: Client | None) -> None:
        """Count a connection as admitted, as a request of it was let in."""
        if client is None or client not in self._pending:
            return
        self._admitted[client] = self._pending.pop(client)
        if len(self._admitted) > MAX_ADMITTED:
            self._admitted.pop(next(iter(self._admitted)))()

    def remove(self, client: Client) -> None:
        """Stop counting a connection, which has ended or became a websocket."""
        self._pending.pop(client, None)
        self._admitted.pop(client, None)

    def _close_pending(self, address: str) -> None:
        oldest = next(client for client in self._pending if client[0] == address)
        self._pending.pop(oldest)()
