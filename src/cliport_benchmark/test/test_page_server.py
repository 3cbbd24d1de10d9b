"""How `bench` speaks to the page's server: what it asks, what it leaves open, when it gives up, how it ends it."""

from __future__ import annotations

import json
import os
import signal
import socket
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from cliport_benchmark import bench_page, page_process
from cliport_benchmark.errors import BenchmarkError
from cliport_benchmark.page_process import PageProcess

PAGE: Any = SimpleNamespace(port=7)


class Server:
    """The page's server, played; `told` is what happened there, in order."""

    def __init__(self, status: int = 200) -> None:
        self.status, self.told = status, list[Any]()

    def http(self, host: str, port: int, timeout: float) -> SimpleNamespace:
        assert timeout == 30
        return SimpleNamespace(
            request=lambda method, path: self.told.append(f"{method} {host}:{port}{path}"),
            getresponse=lambda: SimpleNamespace(status=self.status, read=lambda: b"text"),
            close=lambda: self.told.append("closed"),
            sock=self.socket("picture"),
        )

    def socket(self, name: str) -> SimpleNamespace:
        return SimpleNamespace(
            shutdown=lambda how: self.told.append((name, "shut", how)),
            close=lambda: self.told.append((name, "closed")),
        )

    def websocket(self, url: str, origin: str, open_timeout: float) -> SimpleNamespace:
        assert open_timeout == 30
        self.told.append(f"{url} from {origin}")
        return SimpleNamespace(
            socket=self.socket("session"), recv=lambda timeout: self.told.append(f"reads for {timeout} s")
        )


def played(monkeypatch: pytest.MonkeyPatch, server: Server) -> list[Any]:
    monkeypatch.setattr(bench_page, "HTTPConnection", server.http)
    monkeypatch.setattr(bench_page, "connect", server.websocket)
    return server.told


def test_a_file_is_fetched_on_a_connection_of_its_own(monkeypatch: pytest.MonkeyPatch) -> None:
    told = played(monkeypatch, Server())
    assert bench_page._get(PAGE, "/static/app.js") == b"text"
    assert told == ["GET 127.0.0.1:7/static/app.js", "closed"]
    told = played(monkeypatch, Server(404))
    with pytest.raises(BenchmarkError, match=r"^the page's server answered 404 for /gone\.js$"):
        bench_page._get(PAGE, "/gone.js")
    assert told[-1] == "closed"


def test_a_dropped_page_closes_neither_its_session_nor_its_picture(monkeypatch: pytest.MonkeyPatch) -> None:
    told = played(monkeypatch, Server())
    bench_page._load_and_drop(PAGE, ["/", "/static/app.js"], 12)
    assert told == [
        "GET 127.0.0.1:7/",
        "closed",
        "GET 127.0.0.1:7/static/app.js",
        "closed",
        "GET 127.0.0.1:7/picture/color.jpg?after=0&width=960",
        "ws://127.0.0.1:7/session?page=dropped-page-12 from http://127.0.0.1:7",
        "reads for 30.0 s",
        ("session", "shut", socket.SHUT_RDWR),
        ("session", "closed"),
        ("picture", "shut", socket.SHUT_RDWR),
        ("picture", "closed"),
    ]


@pytest.mark.parametrize(
    ("views", "ready"),
    [
        ([{"view": {"state": "waiting", "words": "no picture"}}, {"other": 1}, {"view": {"state": "ready"}}], True),
        ([{"view": {"state": "waiting", "words": "no picture"}}, {"view": {"state": "waiting"}}, {}], False),
    ],
)
def test_the_page_is_awaited_while_the_graph_lives(views: list[dict[str, Any]], ready: bool) -> None:
    texts = [json.dumps(view) for view in views]
    session: Any = SimpleNamespace(recv=lambda timeout: texts.pop(0))

    class Graph:
        healthy = property(lambda _: bool(texts))

        def log_tail(self) -> str:
            return "the log's end"

    graph: Any = Graph()
    if ready:
        bench_page._wait_ready(session, graph)
    else:
        with pytest.raises(BenchmarkError, match=r"^the page was not ready: no picture\nthe log's end$"):
            bench_page._wait_ready(session, graph)
    assert texts == []


def test_a_page_that_is_not_ready_in_five_minutes_is_given_up(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = iter(range(0, 999, 80))
    monkeypatch.setattr(bench_page, "time", SimpleNamespace(monotonic=lambda: next(clock)))
    read: list[int] = []
    session: Any = SimpleNamespace(recv=lambda timeout: read.append(timeout) or "{}")
    graph: Any = SimpleNamespace(healthy=True, log_tail=lambda: "")
    with pytest.raises(BenchmarkError, match=r"^the page was not ready: \n$"):
        bench_page._wait_ready(session, graph)
    assert read == [30, 30, 30]


def test_cores_are_counted_while_pictures_come_and_growth_after(monkeypatch: pytest.MonkeyPatch) -> None:
    told: list[Any] = []

    @contextmanager
    def part(name: str, *given: Any) -> Iterator[Any]:
        told.append((name, *(g for g in given if not isinstance(g, Path | SimpleNamespace))))
        used = iter([3.0, 8.0])
        yield SimpleNamespace(name=name, cpu_seconds=lambda: next(used))
        told.append(f"{name} ends")

    clock = iter([100.0, 120.0])
    monkeypatch.setattr(bench_page, "time", SimpleNamespace(monotonic=lambda: next(clock)))
    monkeypatch.setattr(bench_page, "GraphProcess", lambda *given: part("graph", *given))
    monkeypatch.setattr(bench_page, "PageProcess", lambda *given: part("page", *given))
    monkeypatch.setattr(bench_page, "_open_page", lambda page, name: part("session", name))
    monkeypatch.setattr(bench_page, "_wait_ready", lambda session, graph: told.append((session.name, graph.name)))
    monkeypatch.setattr(bench_page, "_drained", lambda session: part("drained"))
    monkeypatch.setattr(bench_page, "_latencies", lambda page, n: [float(n)])
    monkeypatch.setattr(bench_page, "_growth", lambda page, loads, warm_up: [float(loads), float(warm_up)])
    assert list(bench_page.page_figures("align-rope")) == [
        ("latency", [200.0]),
        ("cpu_cores", [0.25]),
        ("memory_1000_loads", [1000.0]),
        ("memory_next_1000_loads", [100.0]),
    ]
    assert told == [
        ("graph", "sim.launch.yaml", {"task": "align-rope", "split": "val", "seed": "0"}),
        ("page",),
        ("session", "the-page-that-is-seen"),
        ("session", "graph"),
        ("drained",),
        *(f"{name} ends" for name in ("drained", "session", "page", "graph")),
    ]


@pytest.mark.parametrize(("error", "words"), [(OSError("no route"), "no route"), (TimeoutError(), "TimeoutError")])
def test_a_server_that_does_not_answer_is_one_line(
    monkeypatch: pytest.MonkeyPatch, error: Exception, words: str
) -> None:
    def fails(*_: object) -> None:
        raise error

    monkeypatch.setattr(bench_page, "_figures", fails)
    with pytest.raises(BenchmarkError, match=f"^the page's server does not answer: {words}$"):
        list(bench_page.page_figures("align-rope"))


def running(script: str) -> PageProcess:
    """Return a page's process that runs a shell script in the server's place and has said its first line."""
    page = object.__new__(PageProcess)
    kept = signal.signal(signal.SIGINT, signal.default_int_handler)  # tests in the background ignore it, children too
    page._process = subprocess.Popen(["/bin/sh", "-c", script], stdout=subprocess.PIPE, text=True)
    signal.signal(signal.SIGINT, kept)
    assert page._process.stdout is not None and page._process.stdout.readline() == "on\n"
    return page


def test_a_page_is_interrupted_or_sent_what_was_asked_for() -> None:
    with running("echo on; exec sleep 600") as page:
        pass
    assert page._process.returncode == -signal.SIGINT
    assert running("echo on; exec sleep 600").end(signal.SIGTERM) == -signal.SIGTERM


def test_a_page_that_has_ended_keeps_its_status_and_one_that_will_not_is_killed(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    ended = running("echo on; exit 3")
    assert ended._process.wait(60.0) == 3 and ended.end() == 3
    monkeypatch.setattr(page_process, "_END_TIMEOUT_S", 0.2)
    assert running("trap '' INT; echo on; exec sleep 600").end() == -signal.SIGKILL


@pytest.mark.parametrize(
    ("said", "words"),
    [("port 80 is taken\n", "port 80 is taken"), ("", "see above"), (None, "it gave no address in 0 s")],
)
def test_a_page_that_does_not_start_is_ended(monkeypatch: pytest.MonkeyPatch, said: str | None, words: str) -> None:
    ended: list[PageProcess] = []
    reading, writing = os.pipe()
    if said is not None:
        os.write(writing, said.encode())
        os.close(writing)
    process = SimpleNamespace(stdout=os.fdopen(reading))
    monkeypatch.setattr(page_process.subprocess, "Popen", lambda *_, **__: process)
    monkeypatch.setattr(page_process, "_START_TIMEOUT_S", 10.0 if said is not None else 0.1)
    monkeypatch.setattr(PageProcess, "end", lambda page: ended.append(page))
    with pytest.raises(BenchmarkError, match=f"^the page did not start: {words}$"):
        PageProcess(Path("sets"))
    assert len(ended) == 1
