"""The bench's table: what was measured is written, whatever a later group does; searches are compared."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from cliport_benchmark import bench, bench_page
from cliport_benchmark.bench_planning import OTHERS, Query, clutter_queries, search_times
from cliport_benchmark.errors import BenchmarkError
from cliport_benchmark.provenance import machine_line
from panda_executor.config import SearchAlgorithm
from panda_executor.model import PandaModel


def test_rows_that_were_measured_are_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def fails() -> Iterator[bench.Row]:
        yield bench.row("half", [1.0], "ms")
        raise BenchmarkError("no fresh heightmap")

    groups = {
        "first": lambda: [bench.row("one", [1.0, 3.0], "ms")],
        "second": fails,
        "third": lambda: [bench.row("two", [2.0], "s")],
    }
    monkeypatch.setattr(bench, "BENCHES", groups)
    out = tmp_path / "bench.json"
    assert bench.main(["--out", str(out)]) == 1
    assert capsys.readouterr().out.splitlines() == [
        machine_line(),
        "name                                                        median       min       max  unit     n",
        "one                                                           2.00      1.00      3.00  ms       2",
        "half                                                          1.00      1.00      1.00  ms       1",
        "two                                                           2.00      2.00      2.00  s        1",
        f"written to {out}",
    ]
    assert [row["name"] for row in json.loads(out.read_text())["rows"]] == ["one", "half", "two"]


def test_a_row_has_median_least_and_largest_to_two_digits() -> None:
    assert bench.row("name", [1.006, 3.3333, 0.99444], "ms") == bench.Row("name", 1.01, 0.99, 3.33, "ms", 3)


def test_an_interrupt_writes_what_was_measured(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def interrupted() -> Iterator[bench.Row]:
        yield bench.row("half", [1.0], "ms")
        raise KeyboardInterrupt

    never = {"later": lambda: pytest.fail("it goes on")}
    monkeypatch.setattr(bench, "BENCHES", {"first": interrupted, **never})
    out = tmp_path / "bench.json"
    assert bench.main(["--out", str(out)]) == 130
    assert [row["name"] for row in json.loads(out.read_text())["rows"]] == ["half"]
    assert capsys.readouterr().err == "error: interrupted\n"


def test_a_defect_in_a_group_does_not_cost_the_rows_before(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def broken() -> Iterator[bench.Row]:
        yield bench.row("half", [1.0], "ms")
        raise ZeroDivisionError

    monkeypatch.setattr(bench, "BENCHES", {"first": broken})
    out = tmp_path / "bench.json"
    with pytest.raises(ZeroDivisionError):
        bench.main(["--out", str(out)])
    said = json.loads(out.read_text())
    assert [row["name"] for row in said["rows"]] == ["half"] and "instructions" in said["machine"]


@pytest.fixture(scope="module")
def queries() -> list[Query]:
    return clutter_queries(1)


def test_searches_begin_and_end_on_either_side_over_the_table(queries: list[Query]) -> None:
    ((_, start, goal),) = queries
    right, left = (PandaModel().tcp_arrays(joints)[1] for joints in (start, goal))
    assert -0.35 <= right[1] <= -0.25 and 0.25 <= left[1] <= 0.35
    assert all(0.4 <= point[0] <= 0.6 and 0.1 <= point[2] <= 0.18 for point in (right, left))


@pytest.mark.parametrize("algorithm", list(SearchAlgorithm))
def test_searches_in_clutter_find_ways(queries: list[Query], algorithm: SearchAlgorithm) -> None:
    times, successes = search_times(algorithm, queries)
    assert len(times) == 1 and successes == 1


@pytest.mark.parametrize("name", list(OTHERS))
def test_other_planners_are_asked_the_same(queries: list[Query], name: str) -> None:
    times, _ = search_times(SearchAlgorithm.RRT_CONNECT, queries, OTHERS[name])
    assert len(times) == 1 and 0.0 < times[0] < 1e5


class NoNews:
    """A page that never has a new picture."""

    def __init__(self, *_: Any, **__: Any) -> None:
        self.asked = 0

    def request(self, *_: str) -> None:
        self.asked += 1
        assert self.asked < 1000, "it asks for ever"

    def getresponse(self) -> SimpleNamespace:
        return SimpleNamespace(status=204, read=lambda: b"")


def test_a_page_without_new_pictures_is_given_up(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bench_page, "HTTPConnection", NoNews)
    monkeypatch.setattr(bench_page, "_PICTURE_TIMEOUT_S", 0.0)
    with pytest.raises(BenchmarkError, match="0 s passed without a new picture"):
        list(bench_page._pictures(SimpleNamespace(port=1), 3))  # type: ignore[arg-type]
