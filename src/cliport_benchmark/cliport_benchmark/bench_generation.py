"""Speed of making demonstrations without the arm, beside the public implementation's generator."""

from __future__ import annotations

import os
import tempfile
import time
from functools import partial
from pathlib import Path

import cv2

from cliport_benchmark.generate import GenerateConfig, make_part
from cliport_benchmark.parallel import run_parallel

# seconds an episode that the public implementation takes
PUBLIC_SECONDS = {
    "put-blocks-in-bowls-seen-colors": 6.0,
    "stack-block-pyramid-seq-seen-colors": 18.0,
    "packing-box-pairs-seen-colors": 25.0,
    "towers-of-hanoi-seq-seen-colors": 17.0,
    "separating-piles-seen-colors": 28.0,
    "align-rope": 29.0,
    "assembling-kits-seq-seen-colors": 15.0,
    "packing-unseen-shapes": 6.0,
}
_EPISODES = 8  # a part
_PARTS = 3  # of each process


def episodes_a_minute(task: str) -> list[float]:
    """Measure episodes a minute with all cores at work, from several parts:
    scenes, observations, PNG and Parquet included."""
    processes = os.cpu_count() or 1
    n_parts = _PARTS * processes
    config = GenerateConfig(task, "train", 0, _EPISODES * n_parts, episodes_per_part=_EPISODES)
    with tempfile.TemporaryDirectory() as folder:
        work = run_parallel(partial(_seconds, config, Path(folder)), range(n_parts), processes, _set_up)
        return [processes * 60.0 * _EPISODES / seconds for _, seconds in work]


def _seconds(config: GenerateConfig, folder: Path, part: int) -> float:
    start = time.perf_counter()
    make_part(config, folder, part)
    return time.perf_counter() - start


def _set_up() -> None:
    cv2.setNumThreads(1)
