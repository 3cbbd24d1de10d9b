"""Plans among boxes, columns and shelves, seen by the simulated camera and checked against the simulator's own bodies.

`make soak PYTEST_ARGS=tests/test_cluttered_scenes.py` runs this.
"""

from __future__ import annotations

import json
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import pytest
from cluttered_plans import bench, record_of, summary_of

pytestmark = [pytest.mark.soak, pytest.mark.timeout(7200)]

SCENES = 200
SUCCESS = 0.95  # of the scenes in which there is a way, at least
OUT = Path(__file__).parents[1] / "out/cluttered_scenes.json"


def test_no_plan_touches_a_thing_and_a_way_that_exists_is_found() -> None:
    records = []
    with ProcessPoolExecutor(2, get_context("spawn")) as pool:
        for record in pool.map(record_of, range(SCENES)):
            records.append(record)
            print(record, flush=True)
    summary = summary_of(records)
    OUT.parent.mkdir(exist_ok=True)
    OUT.write_text(json.dumps({**summary, "records": records}, indent=2))
    assert summary["planned"] >= SCENES / 2, "too few plans to say anything"
    assert not summary["touches"]
    assert summary["success"] >= SUCCESS


def test_the_check_sees_what_plans_touch_that_know_of_nothing() -> None:
    touches = [bench().blind_touches(seed) for seed in range(4)]
    assert sum(bool(found) for found in touches) >= 2
    assert all(touch.depth <= 0.0 and touch.first != touch.second for found in touches for touch in found)
