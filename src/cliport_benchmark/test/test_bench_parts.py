"""The parts of `make bench`, with the clock, the page and the planner played."""

from __future__ import annotations

import os
import platform
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from websockets.exceptions import ConnectionClosedOK

from cliport_benchmark import bench, bench_generation, bench_page, bench_perception, bench_planning, provenance
from cliport_benchmark.errors import BenchmarkError
from cliport_benchmark.page_process import PageProcess
from cliport_benchmark.provenance import machine
from cliport_core import WorkspaceSpec
from cliport_core.image_files import encode_jpeg
from panda_executor.config import SearchAlgorithm


def test_a_call_is_timed_after_three_that_are_not(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = iter([0.0, 0.010, 1.0, 1.030, 2.0, 2.020])
    monkeypatch.setattr(bench.time, "perf_counter", lambda: next(clock))
    calls: list[int] = []
    assert bench.timed("name", lambda: calls.append(1), 3) == bench.Row("name", 20.0, 10.0, 30.0, "ms", 3)
    assert len(calls) == 6
    assert bench._ms_between([1.0, 1.5, 2.5], 4) == [125.0, 250.0]


def test_a_frame_is_timed_in_three_ways(monkeypatch: pytest.MonkeyPatch) -> None:
    built: list[int] = []
    both = SimpleNamespace(process=lambda *_: built.append(2))
    rates = {"heightmap_hz": 0.0, "points_hz": 0.0}  # every frame has both
    monkeypatch.setattr(bench_perception, "FrameProcessor", lambda *_, **given: both if given == rates else None)
    parts = {"camera": None, "camera_in_base": None, "workspace": WorkspaceSpec(), "build": lambda *_: built.append(1)}
    frame = SimpleNamespace(color=None, depth=None)
    calls = bench_perception.frame_calls(frame, SimpleNamespace(**parts))  # type: ignore[arg-type]
    assert [(name, count) for name, _, count in calls] == [
        ("heightmap_960x540", 50),
        ("cloud_and_heightmap_960x540", 50),
        ("plain_numpy_heightmap_960x540", 30),
    ]
    for _, call, _ in calls[:2]:
        call()
    assert built == [1, 2]


@pytest.mark.parametrize(
    ("group", "run"), [(None, ["planning", "page"]), ("page", ["page"]), ("generation", ["generation"])]
)
def test_what_takes_minutes_is_measured_on_request_only(monkeypatch: pytest.MonkeyPatch, group, run) -> None:
    ran: list[str] = []
    names = ("planning", "generation", "page", "paper_size")
    monkeypatch.setattr(bench, "BENCHES", {name: lambda name=name: ran.append(name) or [] for name in names})
    rows: list[bench.Row] = []
    assert bench._measure(group, rows) == 0 and (rows, ran) == ([], run)


def test_the_rate_of_all_processes(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[Any] = []

    def run(function, items, processes, set_up):
        asked.append((function.args[0], list(items), processes))
        return [(0, 12.0), (1, 24.0)]

    monkeypatch.setattr(bench_generation, "run_parallel", run)
    monkeypatch.setattr(os, "cpu_count", lambda: 2)
    # 8 episodes in 12 s are 40 a minute, by each of two processes
    assert bench_generation.episodes_a_minute("align-rope") == [80.0, 40.0]
    ((config, items, processes),) = asked
    assert (config.episodes, config.episodes_per_part, config.n_parts) == (48, 8, 6)
    assert (items, processes) == ([0, 1, 2, 3, 4, 5], 2)


def test_the_share_of_searches_that_find_a_way(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bench_planning, "clutter_queries", lambda count: list(range(count)))
    monkeypatch.setattr(bench_planning, "search_times", lambda _, queries, other=None: ([1.0] * len(queries), 3))
    names = [algorithm.value for algorithm in SearchAlgorithm] + list(bench_planning.OTHERS)
    found = [(name, [1.0] * 4, 75.0) for name in names]
    assert list(bench_planning.compared(4)) == found


def test_simulated_time_is_turned_into_the_machines(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = object.__new__(bench_page._SimulatedTime)
    clock._said = []
    for said, written in ((100, 5000), (120, 5040)):
        stamp = SimpleNamespace(sec=1, nanosec=said)
        clock._take(SimpleNamespace(clock=stamp), {"source_timestamp": written})  # type: ignore[arg-type]
    second = 10**9
    assert clock.written([second + 100, second + 105, second + 120]) == [5000.0, 5010.0, 5040.0]
    for stamps in ([second + 99], [second + 105, second + 121]):
        with pytest.raises(BenchmarkError, match="/clock was not heard"):
            clock.written(stamps)
    closed: list[str] = []
    clock.close = lambda: closed.append("closed")  # type: ignore[method-assign]
    monkeypatch.setattr(bench_page, "_SimulatedTime", lambda: clock)
    monkeypatch.setattr(bench_page, "_pictures", lambda page, n: iter([(second + 110, 3_005_020)] * n))

    def later(seconds: float) -> None:
        stamp = SimpleNamespace(sec=1, nanosec=clock._said[-1][0] % second + 20)
        clock._take(SimpleNamespace(clock=stamp), {"source_timestamp": clock._said[-1][1] + 40})  # type: ignore[arg-type]

    monkeypatch.setattr(bench_page.time, "sleep", later)
    clock._said.pop()  # the clock is heard late: the pictures' stamp is waited for
    assert bench_page._latencies(None, 2) == [3.0, 3.0] and closed == ["closed"]  # type: ignore[arg-type]


def test_growth_is_that_of_each_thousand_loads(monkeypatch: pytest.MonkeyPatch) -> None:
    loaded: list[int] = []
    held = iter([50.0, 53.0, 54.5])
    monkeypatch.setattr(bench_page, "_files", lambda page: ["/"])
    monkeypatch.setattr(bench_page, "_load_and_drop", lambda page, files, number: loaded.append(number))
    monkeypatch.setattr(bench_page, "_resting_mb", lambda page: next(held))
    assert bench_page._growth(None, 5, 2) == [3.0, 1.5] and loaded == list(range(12))  # type: ignore[arg-type]


def test_memory_at_rest_is_the_least_in_three_seconds(monkeypatch: pytest.MonkeyPatch) -> None:
    slept: list[float] = []
    monkeypatch.setattr(bench_page.time, "sleep", slept.append)
    readings = iter([9.0, 7.0, 8.0] * 10)
    page = SimpleNamespace(resident_mb=lambda: next(readings))
    assert bench_page._resting_mb(page) == 7.0 and sum(slept) == pytest.approx(3.0) and len(slept) == 30  # type: ignore[arg-type]


def test_the_files_that_a_page_names_are_followed(monkeypatch: pytest.MonkeyPatch) -> None:
    texts = {
        "/": b'<link href="/static/style.css"><script src="/static/app.js">',
        "/static/app.js": b'import "./view.js"; import "./app.js"; // /static/style.css',
    }
    monkeypatch.setattr(bench_page, "_get", lambda page, path: texts.get(path, b"\xff"))
    assert bench_page._files(None) == ["/", "/static/style.css", "/static/app.js", "/static/view.js"]  # type: ignore[arg-type]


def test_time_and_memory_of_a_process_are_the_systems() -> None:
    page = object.__new__(PageProcess)
    page._process = SimpleNamespace(pid=os.getpid())  # type: ignore[assignment]
    before = sum(os.times()[:2])
    assert before - 0.02 <= page.cpu_seconds() <= time.process_time() + 0.02
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    assert page.resident_mb() == pytest.approx(pages * os.sysconf("SC_PAGE_SIZE") / 2**20, rel=0.05)


def test_figures_of_the_page_become_rows(monkeypatch: pytest.MonkeyPatch) -> None:
    def figures(task: str) -> Iterator[tuple[str, list[float]]]:
        yield "latency", [float(n) for n in range(101)]
        yield "cpu_cores", [0.25]
        yield "memory_1000_loads", [3.0]
        yield "memory_next_1000_loads", [1.0]
        raise BenchmarkError("the server ended")

    monkeypatch.setattr("cliport_benchmark.bench_page.page_figures", figures)
    rows: list[bench.Row] = []
    assert bench._measure("page", rows) == 1
    assert [(r.name, r.median, r.unit) for r in rows] == [
        ("page_latency_960x540", 50.0, "ms"),
        ("page_latency_960x540_p95", 95.0, "ms"),
        ("page_cpu_cores", 0.25, "cores"),
        ("page_memory_1000_loads", 3.0, "MB"),
        ("page_memory_next_1000_loads", 1.0, "MB"),
    ]


def test_rates_of_making_data_become_rows(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("cliport_benchmark.bench_generation.PUBLIC_SECONDS", {"align-rope": 30.0})
    monkeypatch.setattr("cliport_benchmark.bench_generation.episodes_a_minute", lambda task: [40.0, 20.0])
    rows = [(r.name, r.median, r.unit, r.n) for r in bench.bench_generation()]
    assert rows == [("generate_fast_align-rope", 30.0, "/min", 2), ("generate_fast_align-rope_ratio", 15.0, "x", 2)]


class Pictures:
    """A page's server that sends pictures of one width, numbered from 1."""

    def __init__(self, width: int) -> None:
        self.width, self.asked, self.closed = width, list[str](), False

    def __call__(self, host: str, port: int, timeout: float) -> Pictures:
        assert (host, port) == ("127.0.0.1", 7)
        return self

    def request(self, method: str, path: str) -> None:
        self.asked.append(path)

    def getresponse(self) -> SimpleNamespace:
        number = len(self.asked)
        headers = {"X-Sequence": str(number), "X-Stamp-Ns": str(100 * number), "X-Level": "3"}
        file = encode_jpeg(np.zeros((4, self.width, 3), np.uint8), 50)
        return SimpleNamespace(status=200, read=lambda: file, headers=headers)

    def close(self) -> None:
        self.closed = True


def test_the_first_five_pictures_are_not_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    served = Pictures(960)
    monkeypatch.setattr(bench_page, "HTTPConnection", served)
    clock = iter(0.25 * n for n in range(99))
    monkeypatch.setattr(bench_page.time, "perf_counter", lambda: next(clock))
    found = list(bench_page._pictures(SimpleNamespace(port=7), 3))  # type: ignore[arg-type]
    assert [stamp for stamp, _ in found] == [600, 700, 800] and served.closed
    assert served.asked[:2] == [
        "/picture/color.jpg?after=0&width=960",
        "/picture/color.jpg?after=1&width=960&level=3&took=250",
    ]


def test_narrow_pictures_are_not_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    served = Pictures(640)
    monkeypatch.setattr(bench_page, "HTTPConnection", served)
    pictures = bench_page._pictures(SimpleNamespace(port=7), 1)  # type: ignore[arg-type]
    asked = iter(range(99))
    request = served.request

    def widens(method: str, path: str) -> None:
        served.width = 960 if next(asked) >= 4 else 640
        request(method, path)

    monkeypatch.setattr(served, "request", widens)
    assert [stamp for stamp, _ in pictures] == [1000]  # the tenth: four narrow ones, five to warm up
    monkeypatch.setattr(bench_page, "HTTPConnection", Pictures(640))
    monkeypatch.setattr(bench_page, "_PICTURE_TIMEOUT_S", 0.0)
    with pytest.raises(BenchmarkError, match="0 s passed without a new picture of the page's full width"):
        list(bench_page._pictures(SimpleNamespace(port=7), 3))  # type: ignore[arg-type]


def test_what_the_server_pushes_is_read_while_the_context_lasts() -> None:
    read, wanted, closed = threading.Event(), threading.Event(), threading.Event()

    class Session:
        def __iter__(self) -> Iterator[str]:
            yield "news"
            read.set()
            wanted.wait(10.0)
            raise ConnectionClosedOK(None, None)

        def close(self) -> None:
            closed.set()
            wanted.set()

    with bench_page._drained(Session()):  # type: ignore[arg-type]
        assert read.wait(10.0) and not closed.is_set()
    assert closed.is_set()


@pytest.mark.parametrize(("given", "seen"), [(None, "7"), (33, "33")])
def test_a_page_is_started_in_its_domain(given: int | None, seen: str, monkeypatch: pytest.MonkeyPatch) -> None:
    started: list[tuple[list[str], dict[str, str]]] = []

    def start(command: list[str], env: dict[str, str], **_: object) -> SimpleNamespace:
        started.append((command, env))
        reading, writing = os.pipe()
        os.write(writing, b"RTPS_TRANSPORT_SHM Error: a port is taken\nOpen http://127.0.0.1:81")

        def go_on() -> None:
            with os.fdopen(writing, "w") as said:
                said.write("23/ in a browser.\n")

        threading.Timer(0.2, go_on).start()
        return SimpleNamespace(stdout=os.fdopen(reading))

    monkeypatch.setenv("ROS_DOMAIN_ID", "7")
    monkeypatch.setattr("cliport_benchmark.page_process.subprocess.Popen", start)
    page = PageProcess(Path("sets"), given, 8123)
    ((command, environment),) = started
    assert command[-4:] == ["--port", "8123", "--data-sets", "sets"]
    assert environment["ROS_DOMAIN_ID"] == seen and environment["ROS_AUTOMATIC_DISCOVERY_RANGE"] == "LOCALHOST"
    assert (page.address, page.port) == ("http://127.0.0.1:8123", 8123)


def test_a_machine_is_described() -> None:
    found = machine()
    assert found["python"] == platform.python_version() and found["cores"] == len(os.sched_getaffinity(0))


@pytest.mark.parametrize(
    ("flags", "named", "said"),
    [
        ("fpu avx avx2 avx512f avx512_bf16 avx512dq", "avx2 avx512f avx512_bf16", "A CPU (avx2 avx512f avx512_bf16)"),
        ("fpu avx2 amx_bf16 amx_tile", "avx2 amx_bf16", "A CPU (avx2 amx_bf16)"),
        ("fpu sse2", "", "A CPU (none of avx2, avx512f, avx512_bf16, amx_bf16)"),
    ],
)
def test_instruction_sets_that_matter_are_told(
    flags: str, named: str, said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "cpuinfo"
    file.write_text(f"processor\t: 0\nmodel name\t: A CPU\nflags\t\t: {flags}\n\nprocessor\t: 1\nflags\t\t: other\n")
    monkeypatch.setattr(provenance, "_PROCESSOR_FILE", file)
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {0, 2, 3})
    assert (machine()["cpu"], machine()["instructions"]) == ("A CPU", named)
    assert provenance.machine_line() == f"{said}, 3 cores"


def test_a_system_that_says_nothing_of_its_processor_has_no_instruction_sets(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(provenance, "_PROCESSOR_FILE", tmp_path / "none")
    assert machine()["instructions"] == "" and machine()["cpu"]
