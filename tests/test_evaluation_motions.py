"""Every trajectory of a hundred episodes, checked a second time as the arm's controller interpolates it.

`make soak PYTEST_ARGS=tests/test_evaluation_motions.py` runs this, with EPISODES=1 before it one of each task.
"""

from __future__ import annotations

import json
import os
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import pytest
from checked_arm import Checked, motions_of

pytestmark = [pytest.mark.soak, pytest.mark.timeout(7200)]

TASKS = (
    "put-blocks-in-bowls-seen-colors",
    "stack-block-pyramid-seq-seen-colors",
    "packing-box-pairs-seen-colors",
    "towers-of-hanoi-seq-seen-colors",
    "separating-piles-seen-colors",
)
EPISODES = int(os.environ.get("EPISODES", "20"))  # a task
BATCH = min(5, EPISODES)
OUT = Path(__file__).parents[1] / "out/evaluation_motions.json"


def test_no_trajectory_passes_a_limit_or_a_margin_of_its_plan() -> None:
    batches = [(task, seed, BATCH) for task in TASKS for seed in range(0, EPISODES, BATCH)]
    done: list[Checked] = []
    with ProcessPoolExecutor(2, get_context("spawn")) as pool:
        for checked in pool.map(motions_of, *zip(*batches, strict=True)):
            done.append(checked)
            print(*checked, flush=True)
    sent = {task: sum(count for name, count, _ in done if name == task) for task in TASKS}
    wrong = [problem for _, _, problems in done for problem in problems]
    OUT.parent.mkdir(exist_ok=True)
    OUT.write_text(json.dumps({"episodes": len(TASKS) * EPISODES, "trajectories": sent, "wrong": wrong}, indent=2))
    assert min(sent.values()) >= 4 * EPISODES
    assert not wrong
