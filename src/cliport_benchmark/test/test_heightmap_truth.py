"""Heightmaps beside the scene's true surface, found by rays from straight above: of a perfect camera, and of kinds."""

from __future__ import annotations

import re

import numpy as np
import pytest
from scipy import ndimage

from cliport_benchmark.depth_error import main, true_surface
from cliport_benchmark.observer import Observer
from cliport_perception.camera_health import HealthLimits
from cliport_perception.table_watch import TableWatch
from sim_bridge.rendering.sensor_noise import SensorKind
from sim_bridge.scene import reset_scene
from sim_bridge.world import SimWorld

TASKS = ("put-blocks-in-bowls-seen-colors", "packing-box-pairs-seen-colors", "towers-of-hanoi-seq-seen-colors")


@pytest.mark.parametrize("task", TASKS)
def test_seen_tops_and_table_are_as_high_as_they_are_and_what_is_hidden_is_a_hole(task: str) -> None:
    world = SimWorld()
    reset_scene(world, task, "val", 2)
    observer = Observer(world.config, n_threads=1, camera_kind=SensorKind.PERFECT)
    heightmap = observer.observe(world)
    truth = true_surface(world, heightmap, observer.camera.camera_in_base.translation)
    world.close()
    assert truth.table.sum() > 20_000 and truth.tops.sum() > 300
    for cells in (truth.table, truth.tops):
        assert heightmap.valid[cells].mean() > 0.99
        off = np.abs(heightmap.height - truth.height)[cells & heightmap.valid]
        assert off.mean() < 0.0005 and np.percentile(off, 99.0) < 0.001
    # Well within a shadow; at its rim a cell is half seen.
    hidden = ndimage.binary_erosion(~truth.seen & ~truth.edges, iterations=2)
    assert hidden.sum() > 50
    assert heightmap.valid[hidden].mean() < 0.05


def test_every_kind_shows_enough_and_the_plain_one_changes_no_threshold() -> None:
    world = SimWorld()
    reset_scene(world, TASKS[0], "val", 2)
    for kind in SensorKind:
        observer = Observer(world.config, n_threads=1, camera_kind=kind)
        frame = observer.frame(world)
        assert observer.heightmap(frame).valid_fraction > HealthLimits().min_valid_fraction + 0.3
        watch = TableWatch(observer.camera.intrinsics, observer.camera.camera_in_base, observer.workspace)
        assert watch.check(frame.depth) is None
        assert watch.noise.sigma is None or watch.noise.sigma < 0.6 * HealthLimits().max_depth_noise
        if kind is SensorKind.PLAIN:
            assert watch.noise.growth == 1.0
    world.close()


def test_averaging_over_frames_lessens_the_spread_and_not_the_holes(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--camera-kind", "stereo", "--frames", "1", "5"]) == 0
    number = r"([-+]?\d+\.\d+)"
    rows = re.findall(
        rf"\| stereo \| [15] \| {number} \| {number} \| {number} \| {number} % \|", capsys.readouterr().out
    )
    (_, spread, top, holes), (_, less_spread, lower_top, same_holes) = (tuple(map(float, row)) for row in rows)
    assert less_spread < 0.7 * spread
    assert lower_top < top, "the highest sample of a cell wins: with less noise it is less high"
    assert abs(same_holes - holes) < 2.0


def test_what_cannot_be_measured_is_named(capsys: pytest.CaptureFixture[str]) -> None:
    for arguments, words in (
        (["--frames", "0"], "--frames must be 1 or more, got 0"),
        (["--task", "x"], "unknown task"),
    ):
        assert main(["--camera-kind", "perfect", *arguments]) == 1
        error = capsys.readouterr().err.strip()
        assert error.startswith("error: ") and words in error and "\n" not in error
