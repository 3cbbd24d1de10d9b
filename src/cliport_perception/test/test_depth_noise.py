"""Depth noise as it is measured on the table, and thresholds that grow with it: today's up to today's noise."""

from __future__ import annotations

import math

import numpy as np
import pytest

from cliport_core import Pose, WorkspaceSpec
from cliport_perception import CameraModel, UnfitFrameError
from cliport_perception.camera_health import CameraHealth, HealthLimits
from cliport_perception.depth_noise import REFERENCE_SIGMA, DepthNoise, DepthNoiseMeter, depth_sigma
from cliport_perception.errors import PerceptionError
from cliport_perception.frame_processor import FrameProcessor
from cliport_perception.heightmap_builder import MAX_DEPTH_STEP, HeightmapBuilder
from cliport_perception.table_watch import TableLimits, TableWatch
from cliport_perception.temporal_filter import TemporalFilter

WORKSPACE = WorkspaceSpec()
CAMERA = CameraModel(640, 360, 360.0, 360.0, 320.0, 180.0)
POSE = Pose.looking_at((0.92, 0.0, 0.87), (0.45, 0.0, 0.0))  # about 1 m from the table, as the simulated camera
PLAIN = 0.0015  # standard deviation of the simulator's plain camera at 1 m [m]


@pytest.fixture(scope="module")
def scene(cast_scene):
    return cast_scene(CAMERA, POSE)


def noisy(scene, rng: np.random.Generator, sigma: float, nearer: float = 0.0) -> np.ndarray:
    """Depth with noise that grows with its square, as the simulator has it; nearer: by which all is [m]."""
    grain = sigma * rng.standard_normal(scene.depth.shape) * scene.depth**2
    return (scene.depth + grain - nearer).astype(np.float32)


def processor(health: CameraHealth | None = None, table: TableLimits | None = None, frames: int = 1) -> FrameProcessor:
    health = health or CameraHealth({}, HealthLimits())
    return FrameProcessor(WORKSPACE, health, 0.0, 0.0, table=table or TableLimits(), depth_frames=frames)


def processed(of: FrameProcessor, scene, depth: np.ndarray, stamp: int = 0):
    return of.process(scene.color, depth, scene.camera, scene.camera_in_base, stamp).heightmap


@pytest.mark.parametrize("sigma", [0.0005, 0.0015, 0.004])
def test_the_noise_is_found_whatever_stands_upon_the_table(sigma: float) -> None:
    rng = np.random.default_rng(0)
    drops = rng.uniform(0.6, 0.95, 4000)
    heights = rng.normal(0.0, sigma, 4000) * drops
    heights[:1200] = rng.uniform(0.004, 0.05, 1200)
    found = depth_sigma(heights, drops)
    assert found == pytest.approx(sigma, rel=0.06)
    assert depth_sigma(heights[:40], drops[:40]) is None


def test_one_odd_frame_changes_little() -> None:
    meter = DepthNoiseMeter()
    assert meter.noise.sigma is None and meter.noise.growth == 1.0
    for sigma in (0.0041, 0.004, 0.02, 0.0039, None):
        meter.add(sigma)
    assert meter.noise.sigma == pytest.approx(0.00405) and meter.noise.growth == pytest.approx(2.025)
    assert DepthNoise(REFERENCE_SIGMA).growth == 1.0


def test_nothing_changes_with_the_simulators_plain_noise(scene) -> None:
    rng, running, alone = np.random.default_rng(0), processor(), HeightmapBuilder(CAMERA, POSE, WORKSPACE)
    for stamp in range(8):
        depth = noisy(scene, rng, PLAIN)
        found, plain = processed(running, scene, depth, stamp), alone.build(scene.color, depth, stamp)
        for name in ("color", "height", "valid"):
            np.testing.assert_array_equal(getattr(found, name), getattr(plain, name))
    assert running._table is not None and running._table.noise.sigma == pytest.approx(PLAIN, rel=0.1)


def test_a_noisier_camera_keeps_its_surfaces_whole(scene) -> None:
    rng, running, alone = np.random.default_rng(0), processor(), HeightmapBuilder(CAMERA, POSE, WORKSPACE)
    for stamp in range(3):
        depth = noisy(scene, rng, 0.0045)
        found = processed(running, scene, depth, stamp)
    before = alone.build(scene.color, depth)
    assert alone.max_depth_step == MAX_DEPTH_STEP
    assert 1.0 - found.valid_fraction < 0.7 * (1.0 - before.valid_fraction), "as many pinholes as before"
    alone.adapt(DepthNoise(0.0045))
    assert alone.max_depth_step == pytest.approx(2.25 * MAX_DEPTH_STEP)
    alone.adapt(DepthNoise(0.001))
    assert alone.max_depth_step == MAX_DEPTH_STEP


@pytest.mark.parametrize(("sigma", "refused"), [(PLAIN, True), (0.004, False)])
def test_a_plane_that_wanders_within_the_noise_is_no_bump(scene, sigma: float, refused: bool) -> None:
    rng, watch = np.random.default_rng(0), TableWatch(CAMERA, POSE, WORKSPACE)
    words = []
    for frame in range(30):
        wander = 0.0045 * math.sin(frame / 5.0)
        words.append(watch.check(noisy(scene, rng, sigma, wander)))
    assert any(words) is refused
    bumped = [watch.check(noisy(scene, rng, sigma, 0.012)) for _ in range(3)]
    assert bumped[-1] is not None and "the camera was moved" in bumped[-1]


def test_frames_are_averaged_over_what_their_noise_lets_differ() -> None:
    rng, truth = np.random.default_rng(0), np.full((80, 100), 1.0, np.float32)

    def spread(adapted: bool) -> float:
        filtered = TemporalFilter(4)
        for _ in range(4):
            last = filtered.add((truth + rng.normal(0.0, 0.006, truth.shape)).astype(np.float32))
            if adapted:
                filtered.adapt(DepthNoise(float(np.std(last - truth))))
        return float(np.std(last - truth))

    assert spread(adapted=True) == pytest.approx(0.003, rel=0.1)
    assert spread(adapted=False) > 0.0035


def test_too_much_noise_is_refused_and_said(scene) -> None:
    health = CameraHealth({}, HealthLimits())
    running, rng = processor(health), np.random.default_rng(0)
    with pytest.raises(
        UnfitFrameError, match=r"depth has 7\.\d mm of noise on the table \(at most 5\): set depth_frames"
    ):
        processed(running, scene, noisy(scene, rng, 0.0075))
    assert float(health.report(0, 1, 0).values["depth_noise_mm"]) == pytest.approx(7.5, rel=0.1)
    assert health.check_noise(0.0049) is None and health.check_noise(None) is None
    assert "depth_noise_mm" not in health.report(0, 1, 0).values
    assert CameraHealth({}, HealthLimits(max_depth_noise=0.0)).check_noise(1.0) is None
    with pytest.raises(PerceptionError, match="max_depth_noise must be 0 or more and finite"):
        HealthLimits(max_depth_noise=math.nan)


def test_half_of_the_workspace_must_be_seen_by_all_cameras_together(scene) -> None:
    limits = HealthLimits()
    assert limits.min_valid_fraction == 0.5 and limits.of_each(2).min_valid_fraction == 0.25
    third = scene.depth.copy()
    third[:, : 9 * third.shape[1] // 20] = np.nan
    seen = HeightmapBuilder(CAMERA, POSE, WORKSPACE).build(scene.color, third).valid_fraction
    third[:, : 11 * third.shape[1] // 20] = np.nan
    less = HeightmapBuilder(CAMERA, POSE, WORKSPACE).build(scene.color, third).valid_fraction
    assert seen > 0.5 > less
    with pytest.raises(
        UnfitFrameError, match=r"depth is valid in [34]\d\.\d % of the workspace \(at least 50 % needed\)"
    ):
        processed(processor(), scene, third)
