"""The demonstration page on the running graph: how old its live picture is, what it costs, whether it keeps memory."""

from __future__ import annotations

import json
import re
import socket
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from http.client import HTTPConnection, HTTPException
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import rclpy
from rclpy.executors import SingleThreadedExecutor
from rosgraph_msgs.msg import Clock
from websockets.exceptions import ConnectionClosed, WebSocketException
from websockets.sync.client import ClientConnection, connect
from websockets.typing import Origin

from cliport_benchmark.errors import BenchmarkError
from cliport_benchmark.graph_process import GraphProcess
from cliport_benchmark.page_process import PageProcess
from cliport_core import topics
from cliport_core.errors import ImageError
from cliport_core.image_files import decode_color_file
from cliport_core.ros_running import SpinThread

WIDTH = 960  # of the camera's picture and of the page's [pixels]
# Guards against hanging, for machines much slower than the figures' [s]
_READY_S = 300.0
_ANSWER_S = 30.0  # wait for the server's answer at most
_CLOCK_TIMEOUT_S = 60.0  # wait for /clock at most
_PICTURE_TIMEOUT_S = 30.0  # wait for a new picture at most
_N_WARM_UP = 5  # pictures that lay ready before they were asked for, and are not counted
_REST_S, _N_READINGS = 3.0, 30  # time in which memory comes to rest, and readings in it


def page_figures(
    task: str, pictures: int = 200, loads: int = 1000, warm_up: int = 100
) -> Iterator[tuple[str, list[float]]]:
    """Measure the page's process in the simulator's graph, at real time, with one page open; yield each figure.

    latency [ms]: of each picture, see `_latencies`. cpu_cores: its processor time over wall time meanwhile.
    memory_1000_loads [MB]: its growth over so many page loads whose websocket is dropped without a close, after a
    warm-up; memory_next_1000_loads: over as many more.

    Raises:
        BenchmarkError: when the graph or the page does not come up, or the page stops answering.
    """
    try:
        yield from _figures(task, pictures, loads, warm_up)
    except (OSError, HTTPException, WebSocketException) as error:
        raise BenchmarkError(f"the page's server does not answer: {str(error) or type(error).__name__}") from error


def _figures(task: str, pictures: int, loads: int, warm_up: int) -> Iterator[tuple[str, list[float]]]:
    with tempfile.TemporaryDirectory() as name:
        log, sets = Path(name) / "log", Path(name) / "sets"
        with (
            GraphProcess("sim.launch.yaml", {"task": task, "split": "val", "seed": "0"}, log) as graph,
            PageProcess(sets) as page,
            _open_page(page, "the-page-that-is-seen") as session,
        ):
            _wait_ready(session, graph)
            with _drained(session):
                began, used = time.monotonic(), page.cpu_seconds()
                latencies = _latencies(page, pictures)
                cores = (page.cpu_seconds() - used) / (time.monotonic() - began)
                yield "latency", latencies
                yield "cpu_cores", [cores]
                for name, growth in zip(("", "next_"), _growth(page, loads, warm_up), strict=True):
                    yield f"memory_{name}{loads}_loads", [growth]


class _SimulatedTime:
    """Relation of simulated time to this machine's clock: /clock, and when the simulator wrote it."""

    def __init__(self) -> None:
        self._said: list[tuple[int, int]] = []  # simulated time, time of writing [ns]
        self._context = rclpy.Context()
        self._context.init()
        self._node = rclpy.create_node("bench_page", context=self._context)
        self._node.create_subscription(Clock, topics.CLOCK, self._take, 100)  # type: ignore[arg-type]
        executor = SingleThreadedExecutor(context=self._context)  # it tells callbacks when a message was written
        self._spinner = SpinThread(self._node, lambda _: None, self._context, executor)
        self.wait_until(0)

    def close(self) -> None:
        self._spinner.stop()
        self._node.destroy_node()
        self._context.try_shutdown()

    def wait_until(self, stamp_ns: int) -> None:
        """Wait until /clock has passed a simulated time, `_CLOCK_TIMEOUT_S` at most."""
        deadline = time.monotonic() + _CLOCK_TIMEOUT_S
        while (not self._said or self._said[-1][0] < stamp_ns) and time.monotonic() < deadline:
            time.sleep(0.05)

    def written(self, stamps_ns: list[int]) -> list[float]:
        """Return when a simulated time was written, by this machine's clock [ns], interpolated between messages."""
        simulated, wall = np.array(self._said, dtype=np.float64).reshape(-1, 2).T
        if not len(simulated) or min(stamps_ns) < simulated[0] or max(stamps_ns) > simulated[-1]:
            raise BenchmarkError("/clock was not heard for the time of all pictures: is the simulator running?")
        return [float(ns) for ns in np.interp(stamps_ns, simulated, wall)]

    def _take(self, message: Clock, info: Any) -> None:
        self._said.append((message.clock.sec * 10**9 + message.clock.nanosec, info["source_timestamp"]))


def _latencies(page: PageProcess, n: int) -> list[float]:
    """Measure the time from the camera's stamp to decoded pixels, of n pictures
    that are fetched one by one as the page does [ms].

    The stamp is simulated time. That is turned into this machine's by the times at which the simulator wrote /clock
    (50 Hz, in between by proportion): so a simulation that falls behind real time does not count. Exact to the 5 ms
    in which the simulator's steps follow one another. Rendering the picture is in it; drawing it on a screen is not.
    """
    clock = _SimulatedTime()
    try:
        seen = list(_pictures(page, n))
        clock.wait_until(max(stamp for stamp, _ in seen))
        written = clock.written([stamp for stamp, _ in seen])
    finally:
        clock.close()
    return [(arrived - start) / 1e6 for (_, arrived), start in zip(seen, written, strict=True)]


def _pictures(page: PageProcess, n: int) -> Iterator[tuple[int, int]]:
    """Return stamp and arrival of each picture [ns], after the first few; see live.js.

    Narrower ones, which the server sends while the machine is busy, are not counted.

    Raises:
        BenchmarkError: when no picture of full width comes for `_PICTURE_TIMEOUT_S`, or one is refused or unreadable.
    """
    connection = HTTPConnection("127.0.0.1", page.port, timeout=_ANSWER_S)
    after, known = "0", ""
    count = -_N_WARM_UP
    deadline = time.monotonic() + _PICTURE_TIMEOUT_S
    while count < n:
        connection.request("GET", f"/picture/color.jpg?after={after}&width={WIDTH}{known}")
        answer = connection.getresponse()
        began = time.perf_counter()
        file = answer.read()
        if time.monotonic() > deadline:
            raise BenchmarkError(f"{_PICTURE_TIMEOUT_S:.0f} s passed without a new picture of the page's full width")
        if answer.status == 204:
            continue
        if answer.status != 200:
            raise BenchmarkError(f"the page's picture was refused: {answer.status} {file[:80].decode()}")
        took = round(1000 * (time.perf_counter() - began))
        try:
            picture = decode_color_file(file)
        except ImageError as error:
            raise BenchmarkError(f"the page's picture cannot be read: {error}") from None
        arrived = time.time_ns()
        after, known = answer.headers["X-Sequence"], f"&level={answer.headers['X-Level']}&took={took}"
        if picture.shape[1] != WIDTH:
            continue
        deadline = time.monotonic() + _PICTURE_TIMEOUT_S
        count += 1
        if count > 0:
            yield int(answer.headers["X-Stamp-Ns"]), arrived
    connection.close()


def _growth(page: PageProcess, loads: int, warm_up: int) -> list[float]:
    """Measure the growth of memory over page loads, and over as many again: only what leaks grows there, too [MB]."""
    files = _files(page)
    held, first = [], 0
    for last in (warm_up, warm_up + loads, warm_up + 2 * loads):
        for number in range(first, last):
            _load_and_drop(page, files, number)
        held.append(_resting_mb(page))
        first = last
    return [after - before for before, after in pairwise(held)]


def _files(page: PageProcess) -> list[str]:
    """Return the files that a browser asks for: the page, what it names, and what its scripts import."""
    files = ["/"]
    for path in files:  # which grows
        text = _get(page, path).decode(errors="replace")
        named = re.findall(r"/static/[\w.]+", text) + [
            f"/static/{name}" for name in re.findall(r'"\./(\w+\.js)"', text)
        ]
        files += [name for name in dict.fromkeys(named) if name not in files]
    return files


def _load_and_drop(page: PageProcess, files: list[str], number: int) -> None:
    """Load the page as a browser whose connection breaks: no websocket is closed, the next picture is never read."""
    for path in files:
        _get(page, path)
    picture = HTTPConnection("127.0.0.1", page.port, timeout=_ANSWER_S)
    picture.request("GET", f"/picture/color.jpg?after=0&width={WIDTH}")
    session = _open_page(page, f"dropped-page-{number}")
    session.recv(timeout=_ANSWER_S)
    for broken in (session.socket, picture.sock):
        broken.shutdown(socket.SHUT_RDWR)
        broken.close()


def _get(page: PageProcess, path: str) -> bytes:
    connection = HTTPConnection("127.0.0.1", page.port, timeout=_ANSWER_S)
    connection.request("GET", path)
    answer = connection.getresponse()
    file = answer.read()
    connection.close()
    if answer.status != 200:
        raise BenchmarkError(f"the page's server answered {answer.status} for {path}")
    return file


def _resting_mb(page: PageProcess) -> float:
    """Return the least memory that the process holds in some seconds: pictures come and go [MB]."""
    found = []
    for _ in range(_N_READINGS):
        time.sleep(_REST_S / _N_READINGS)
        found.append(page.resident_mb())
    return min(found)


def _open_page(page: PageProcess, name: str) -> ClientConnection:
    origin = Origin(f"http://127.0.0.1:{page.port}")
    return connect(f"ws://127.0.0.1:{page.port}/session?page={name}", origin=origin, open_timeout=_ANSWER_S)


def _wait_ready(session: ClientConnection, graph: GraphProcess) -> None:
    """Wait until the page has a picture to act on. Raises BenchmarkError."""
    deadline, words = time.monotonic() + _READY_S, ""
    while time.monotonic() < deadline and graph.healthy:
        view = json.loads(session.recv(timeout=_ANSWER_S)).get("view", {})
        words = view.get("words", words)
        if view.get("state") == "ready":
            return
    raise BenchmarkError(f"the page was not ready: {words}\n{graph.log_tail()}")


@contextmanager
def _drained(session: ClientConnection) -> Iterator[None]:
    """Read what the server pushes for as long as the context lasts."""

    def read() -> None:
        try:
            for _ in session:
                pass
        except ConnectionClosed:
            return

    reader = threading.Thread(target=read, daemon=True)
    reader.start()
    try:
        yield
    finally:
        session.close()
        reader.join(5.0)
