"""Thousands of page loads, silent connections and broken ones: memory stays flat, and STOP is heard within 0.3 s.

`make soak PYTEST_ARGS="src/demo_tool/test/test_soak_page.py -s"` runs this and prints the figures; a few minutes.
The time is from the page's request to the station's call that stops the arm.
"""

from __future__ import annotations

import http.client
import json
import re
import socket
import statistics
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest
import soak_server
from web_workplace import PATIENCE
from websockets.sync.client import ClientConnection, connect

from demo_tool.web.guard import COOKIE

pytestmark = [pytest.mark.soak, pytest.mark.timeout(1800)]
TOKEN = "a-long-enough-token"
LOADS, WARM_UP, IDLE = 1000, 100, 96
MOST_DELAY = 0.3  # s
MOST_GROWTH = 10.0  # MB over the second thousand of loads: only what leaks grows there, too
STATES = (
    *("waiting_for_camera", "stale", "ready", "planning", "executing", "recording", "proposing", "failed", "stopped"),
    *("waiting_for_approval", "recovering"),
)


class Served:
    """A server in another process, and who asks it."""

    def __init__(self, folder: Path) -> None:
        command = [sys.executable, soak_server.__file__, str(folder), TOKEN]
        environment = {"PYTHONPATH": ":".join(sys.path)}
        self._process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=environment
        )
        self.port, self._cookie = self._answer()
        self.delays: list[float] = []

    def tell(self, *words: str) -> Any:
        assert self._process.stdin is not None
        print(json.dumps(words), file=self._process.stdin, flush=True)
        return self._answer()

    def _answer(self) -> Any:
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        assert line, "the server has ended"
        return json.loads(line)

    def close(self) -> None:
        assert self._process.stdin is not None
        self._process.stdin.close()
        self._process.wait(PATIENCE)

    @property
    def headers(self) -> dict[str, str]:
        return {"Cookie": f"{COOKIE}={self._cookie}", "Origin": f"http://127.0.0.1:{self.port}"}

    def get(self, path: str) -> bytes:
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=PATIENCE)
        connection.request("GET", path, headers=self.headers)
        answer = connection.getresponse()
        file = answer.read()
        connection.close()
        assert answer.status == 200, (path, answer.status, file[:80])
        return file

    def open_page(self, name: str) -> ClientConnection:
        return connect(
            f"ws://127.0.0.1:{self.port}/session?page={name}",
            origin=self.headers["Origin"],  # type: ignore[arg-type]
            additional_headers={"Cookie": self.headers["Cookie"]},
        )

    def stop(self) -> None:
        """Press STOP on a page that has just come, note how long that took, and resume."""
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=PATIENCE)
        pressed = time.monotonic()
        connection.request("POST", "/stop", headers=self.headers)
        assert connection.getresponse().status == 204
        connection.close()
        self.delays.append(min(moment for moment in self.tell("stops") if moment >= pressed) - pressed)

    def files(self) -> list[str]:
        """What a browser asks for: the page, what it names, and what its scripts import."""
        files = ["/"]
        for path in files:  # which grows
            text = self.get(path).decode(errors="replace")
            named = re.findall(r"/static/[\w.]+", text)
            named += [f"/static/{name}" for name in re.findall(r'"\./(\w+\.js)"', text)]
            files += [name for name in dict.fromkeys(named) if name not in files]
        return files


@pytest.fixture
def served(tmp_path: Path) -> Iterator[Served]:
    server = Served(tmp_path)
    try:
        yield server
    finally:
        server.close()


def drop(page: ClientConnection) -> None:
    """Break a page's connection, with no closing word."""
    page.socket.shutdown(socket.SHUT_RDWR)
    page.socket.close()


def load_and_drop(served: Served, files: list[str], number: int) -> None:
    for path in files:
        served.get(path)
    page = served.open_page(f"dropped-{number}")
    page.recv(timeout=PATIENCE)
    drop(page)


def resting_memory(served: Served) -> float:
    """The least that is held in some seconds: pictures come and go [MB]."""
    found = []
    for _ in range(10):
        time.sleep(0.3)
        found.append(served.tell("memory"))
    return min(found)


def test_every_state_of_the_page_is_tried() -> None:
    text = (Path(soak_server.__file__).parents[1] / "demo_tool/static/protocol.d.ts").read_text()
    declared = re.search(r"export type State =(.*?);", text, re.S)
    assert declared is not None and set(re.findall(r'"(\w+)"', declared[1])) == set(STATES)


def test_loads_and_silent_connections_leave_memory_and_stop_as_they_were(served: Served) -> None:
    files, held = served.files(), list[float]()
    first = 0
    for last in (WARM_UP, WARM_UP + LOADS, WARM_UP + 2 * LOADS):
        for number in range(first, last):
            if number % 100 == 0:
                idle = ExitStack()
                for _ in range(IDLE):
                    idle.enter_context(socket.create_connection(("127.0.0.1", served.port)))
            load_and_drop(served, files, number)
            if number % 25 == 0:
                served.stop()
            if number % 100 == 99:
                idle.close()
        served.tell("rest")
        held.append(resting_memory(served))
        first = last
    growth = [held[1] - held[0], held[2] - held[1]]
    print(
        f"\nmemory after {WARM_UP} loads {held[0]:.1f} MB, {growth[0]:+.1f} MB over {LOADS}, then {growth[1]:+.1f} MB"
    )
    report(served)
    assert growth[1] < MOST_GROWTH


@pytest.mark.parametrize("state", STATES)
def test_a_dropped_connection_keeps_nobody_from_the_stop(served: Served, state: str) -> None:
    served.tell("rest")
    with ExitStack() as idle:
        for _ in range(IDLE):
            idle.enter_context(socket.create_connection(("127.0.0.1", served.port)))
        for number in range(5):
            page = served.open_page(f"holder-{number}")
            page.recv(timeout=PATIENCE)
            served.tell("state", state)
            drop(page)
            served.stop()
            served.tell("rest")
    print(f"\n{state}:", end=" ")
    report(served)


def report(served: Served) -> None:
    worst, median = max(served.delays), statistics.median(served.delays)
    print(f"{len(served.delays)} STOPs: median {1000 * median:.0f} ms, longest {1000 * worst:.0f} ms")
    assert worst < MOST_DELAY
