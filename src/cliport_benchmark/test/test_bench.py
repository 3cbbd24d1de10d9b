"""The bench's table: what was measured is written, whatever a later group does; searches are compared."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import pytest

from cliport_benchmark import bench
from cliport_benchmark.bench_planning import clutter_queries, search_times
from cliport_benchmark.errors import BenchmarkError
from panda_executor.config import SearchAlgorithm


def test_rows_that_were_measured_are_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
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
    assert [row["name"] for row in json.loads(out.read_text())["rows"]] == ["one", "half", "two"]


@pytest.mark.parametrize("algorithm", list(SearchAlgorithm))
def test_searches_in_clutter_find_ways(algorithm: SearchAlgorithm) -> None:
    times, successes = search_times(algorithm, clutter_queries(1))
    assert len(times) == 1 and successes == 1
