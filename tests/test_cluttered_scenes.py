"""Plans among boxes, columns and shelves, seen by the simulated camera and checked against the simulator's own bodies.

`make soak PYTEST_ARGS=tests/test_cluttered_scenes.py` runs this, SEEDS=1000:1040 before it a part.
"""

from __future__ import annotations

import json
import os
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import pytest
from cluttered_plans import CAMERAS, bench, record_of, summary_of

pytestmark = [pytest.mark.soak, pytest.mark.timeout(4 * 3600)]

SEEDS = range(*(int(end) for end in os.environ.get("SEEDS", "0:200").split(":")))  # a subset by SEEDS=first:end
SUCCESS = 0.95  # of the scenes in which there is a way, at least
OUT = Path(__file__).parents[1] / "out/cluttered_scenes.json"


@pytest.fixture(scope="module")
def summaries() -> dict[int, dict[str, Any]]:
    """What came of all scenes, by the number of cameras."""
    records = []
    with ProcessPoolExecutor(2, get_context("spawn")) as pool:
        for record in pool.map(record_of, SEEDS):
            records.append(record)
            print(record, flush=True)
    found = {cameras: summary_of(records, cameras) for cameras in CAMERAS}
    OUT.parent.mkdir(exist_ok=True)
    OUT.write_text(json.dumps({"summaries": list(found.values()), "records": records}, indent=2))
    return found


@pytest.mark.parametrize("cameras", CAMERAS)
def test_no_plan_touches_a_thing(summaries: dict[int, dict[str, Any]], cameras: int) -> None:
    assert summaries[cameras]["planned"] >= len(SEEDS) / 2, "too few plans to say anything"
    assert not summaries[cameras]["touches"]


@pytest.mark.parametrize("cameras", CAMERAS)
def test_a_way_that_exists_is_found(summaries: dict[int, dict[str, Any]], cameras: int) -> None:
    assert summaries[cameras]["success"] >= SUCCESS


def test_the_check_sees_what_plans_touch_that_know_of_nothing() -> None:
    touches = [bench().blind_touches(seed) for seed in range(4)]
    assert sum(bool(found) for found in touches) >= 2
    assert all(touch.depth <= 0.0 and touch.first != touch.second for found in touches for touch in found)
