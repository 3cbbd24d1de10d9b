"""A page's connection to the server, as its script has it: commands out, answers and the view in."""

from __future__ import annotations

import json

from web_workplace import PATIENCE, Workplace
from websockets.sync.client import ClientConnection, connect


def opened(place: Workplace, name: str = "only-page") -> ClientConnection:
    """Open the connection of a page of that name; with news that nobody reads it closes after a second."""
    address = f"ws://127.0.0.1:{place.port}/session?page={name}"
    return connect(address, origin=place.url, close_timeout=1.0)  # type: ignore[arg-type]


def ask(page: ClientConnection, command: str, **arguments: object) -> dict:
    """Send a command and return its answer."""
    page.send(json.dumps({"id": 1, "command": command, "arguments": arguments}))
    while "id" not in (message := json.loads(page.recv(timeout=PATIENCE))):
        pass
    return message


def until(page: ClientConnection, key: str, value: object) -> None:
    """Wait until the view says so."""
    while json.loads(page.recv(timeout=PATIENCE)).get("view", {}).get(key, ...) != value:
        pass
