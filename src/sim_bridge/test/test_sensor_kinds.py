"""Depth cameras of several kinds: each errs in its own way, and unseen stays unseen."""

from __future__ import annotations

import hashlib

import numpy as np
import pytest

from cliport_core import WorkspaceSpec
from cliport_perception import CameraModel, heightmap_from_rgbd
from sim_bridge.rendering.clean_frame import CleanFrame
from sim_bridge.rendering.mounting import load_mounting
from sim_bridge.rendering.sensor_noise import NoiseConfig, SensorKind, with_noise

SHAPE = (120, 160)


def flat(depth: float = 1.0, color: int = 120) -> CleanFrame:
    return CleanFrame(
        np.full((*SHAPE, 3), color, np.uint8), np.full(SHAPE, depth, np.float32), np.ones(SHAPE, np.float32)
    )


def seen(clean: CleanFrame, kind: SensorKind, seed: int = 0) -> np.ndarray:
    return with_noise(clean, NoiseConfig.of_kind(kind), np.random.default_rng(seed))[1]


def test_the_plain_kind_is_what_it_was() -> None:
    clean = flat()
    plain, usual = (with_noise(clean, noise, np.random.default_rng(3)) for noise in
                    (NoiseConfig.of_kind(SensorKind.PLAIN), NoiseConfig()))  # fmt: skip
    np.testing.assert_array_equal(plain[1], usual[1])
    assert NoiseConfig.of_kind(SensorKind.PLAIN) == NoiseConfig()


@pytest.mark.parametrize("kind", list(SensorKind), ids=lambda kind: kind.value)
def test_bias_and_spread_are_those_of_the_kind(kind: SensorKind) -> None:
    config = NoiseConfig.of_kind(kind)
    for distance in (0.7, 1.1):
        depth = seen(flat(distance), kind)
        off = depth[np.isfinite(depth)] - distance
        coarse = config.step * distance**2
        assert off.mean() == pytest.approx(config.bias * distance**2, abs=0.25 * coarse + 2e-4)
        assert off.std() == pytest.approx(np.hypot(config.depth_sigma * distance**2, coarse / 12**0.5), rel=0.25)


def test_disparities_are_whole_numbers() -> None:
    config = NoiseConfig.of_kind(SensorKind.STRUCTURED_LIGHT)
    depth = seen(flat(), SensorKind.STRUCTURED_LIGHT)
    values = np.unique(depth[np.isfinite(depth)].astype(np.float64))
    disparity = 1.0 / (config.step * values)
    np.testing.assert_allclose(disparity, np.rint(disparity), atol=1e-3)
    assert len(values) < 12


def test_time_of_flight_has_pixels_between_two_surfaces_and_others_do_not() -> None:
    clean = flat()
    clean.depth[:, 80:] = 0.8
    between = {}
    for kind in SensorKind:
        depth = seen(clean, kind)
        between[kind] = int(np.count_nonzero((depth > 0.83) & (depth < 0.97)))
    assert between[SensorKind.TIME_OF_FLIGHT] > 40
    assert all(count == 0 for kind, count in between.items() if kind is not SensorKind.TIME_OF_FLIGHT)


@pytest.mark.parametrize("kind", [SensorKind.STRUCTURED_LIGHT, SensorKind.TIME_OF_FLIGHT], ids=lambda kind: kind.value)
def test_dark_things_are_lost(kind: SensorKind) -> None:
    dark, light = (np.isnan(seen(flat(color=color), kind)).mean() for color in (10, 120))
    assert dark == pytest.approx(NoiseConfig.of_kind(kind).dark_loss, abs=0.05) and light < 0.02


GLOSSY = (SensorKind.STRUCTURED_LIGHT, SensorKind.TIME_OF_FLIGHT, SensorKind.STEREO)


@pytest.mark.parametrize("kind", list(SensorKind), ids=lambda kind: kind.value)
def test_glossy_things_are_lost_where_they_mirror_the_light_and_matt_ones_are_not(kind: SensorKind) -> None:
    """Rows face the camera more and more; the right half is painted red, the left one is grey."""
    clean = flat()
    clean.color[:, 80:] = (200, 30, 40)
    clean.facing[:] = np.linspace(0.3, 1.0, SHAPE[0], dtype=np.float32)[:, None]
    lost = np.isnan(seen(clean, kind))
    config = NoiseConfig.of_kind(kind)
    turned = (clean.facing > config.gloss_facing) | (clean.facing < config.gloss_grazing)
    wanted = config.gloss_loss if kind in GLOSSY else 0.002
    assert (config.gloss_loss > 0.0) is (kind in GLOSSY)
    assert lost[:, 80:][turned[:, 80:]].mean() == pytest.approx(wanted, abs=0.06)
    assert lost[:, 80:][~turned[:, 80:]].mean() < 0.02 and lost[:, :80].mean() < 0.02


def test_time_of_flight_tells_whole_millimetres() -> None:
    depth = seen(flat(1.2345), SensorKind.TIME_OF_FLIGHT)
    millimetres = 1e3 * depth[np.isfinite(depth)].astype(np.float64)
    np.testing.assert_allclose(millimetres, np.rint(millimetres), atol=1e-3)
    assert len(np.unique(np.rint(millimetres))) > 5


@pytest.mark.parametrize(
    ("kind", "digest"),
    [(SensorKind.PLAIN, "fadf3be0a3d6e9ce"), (SensorKind.PERFECT, "a7eccccb67e179b4")],
    ids=lambda of: str(of),
)
def test_plain_and_perfect_frames_are_the_recorded_ones(kind: SensorKind, digest: str) -> None:
    """Every score and data set was made with these: a change here makes them incomparable."""
    clean = flat()
    clean.color[:, 80:], clean.depth[40:80, 40:100] = (200, 30, 40), 0.9
    clean.facing[:] = np.linspace(0.1, 1.0, SHAPE[0], dtype=np.float32)[:, None]
    color, depth = with_noise(clean, NoiseConfig.of_kind(kind), np.random.default_rng(5))
    assert hashlib.sha256(color.tobytes() + np.nan_to_num(depth).tobytes()).hexdigest()[:16] == digest


@pytest.mark.parametrize("kind", list(SensorKind), ids=lambda kind: kind.value)
def test_the_table_stays_within_millimetres_and_holes_stay_holes(kind: SensorKind) -> None:
    """A level table through each kind: the bias shows, what was lost is not invented."""
    camera, pose, spec = CameraModel(480, 270, 270.0, 270.0, 240.0, 135.0), load_mounting(), WorkspaceSpec()
    rays = camera.rays().astype(np.float64) @ pose.rotation.T
    depth = (-pose.translation[2] / rays[..., 2]).astype(np.float32)
    color = np.full((*depth.shape, 3), 120, np.uint8)
    clean = CleanFrame(color, depth, np.ones_like(depth))
    noisy = seen(clean, kind)
    noisy[100:140, 200:260] = np.nan
    heightmap = heightmap_from_rgbd(color, noisy, camera, pose, spec)
    off = heightmap.height[heightmap.valid]
    assert abs(np.median(off)) < 0.006 and heightmap.valid.mean() > 0.5
    middle = camera.project(pose.inverse().apply(np.array([[0.45, 0.0, 0.0]])))[0]
    hole = (100 <= middle[0] < 140) and (200 <= middle[1] < 260)
    assert hole and not heightmap.valid[spec.xy_to_pixel(0.45, 0.0)]
