"""Light, colours, patterns and windows of pictures, worked out by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest

from cliport_core import Pose, WorkspaceSpec
from cliport_perception import CameraModel
from sim_bridge.colors import COLORS, SEEN_PALETTE, UNSEEN_PALETTE, random_brown
from sim_bridge.errors import SimulationError
from sim_bridge.rendering.appearance import Appearance, AppearanceRanges, random_appearance, random_light, random_table
from sim_bridge.rendering.backdrop import TABLE_TRIANGLES, backdrop_colors, backdrop_mesh
from sim_bridge.rendering.clean_frame import CleanFrame
from sim_bridge.rendering.image_window import ImageWindow
from sim_bridge.rendering.rays import Rays, dot, turned
from sim_bridge.rendering.sensor_noise import NoiseConfig, SensorKind, with_noise
from sim_bridge.rendering.shading import shade
from sim_bridge.rendering.table_texture import Pattern, TableTexture, _lattice
from sim_bridge.rendering.view import View, along_light

# 1 m above x = 0.45, looking down: rows along -x, columns along -y
DOWN = Pose(np.array([[0.0, -1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, -1.0]]), np.array([0.45, 0.0, 1.0]))
CAMERA = CameraModel(120, 100, 100.0, 100.0, 60.0, 50.0)


@pytest.mark.parametrize(
    ("azimuth", "elevation", "direction"),
    [(0, 90, (0, 0, 1)), (0, 30, (0.8660, 0, 0.5)), (90, 60, (0, 0.5, 0.8660)), (180, 5, (-0.9962, 0, 0.0872))],
)
def test_where_the_light_comes_from(azimuth: float, elevation: float, direction: tuple[float, ...]) -> None:
    look = Appearance(light_azimuth=math.radians(azimuth), light_elevation=math.radians(elevation))
    assert look.to_light == pytest.approx(direction, abs=1e-4)


@pytest.mark.parametrize("elevation", [4.9, 90.1])
def test_a_light_beside_or_below_the_table_is_refused(elevation: float) -> None:
    with pytest.raises(SimulationError, match="give one from 5 to 90"):
        Appearance(light_elevation=math.radians(elevation))


def test_a_surface_shows_what_falls_on_it() -> None:
    """A light at 30 degrees: a level surface takes half of it, one that faces it all, a dark one none."""
    look = Appearance(light_azimuth=0.0, light_elevation=math.radians(30.0), diffuse=0.4, ambient=0.5)
    color = np.tile(np.array([[100.0, 200.0, 250.0]], np.float32), (5, 1))
    ray = look.to_light
    normals = np.array([(0, 0, 1), ray, (0, 0, 1), (-1, 0, 0), (0, 0, -1)], np.float32)
    shown = shade(look, color, normals, np.array([False, False, True, False, False]))
    shares = [0.5 + 0.2, 0.5 * (0.85 + 0.075) + 0.4, 0.5, 0.5 * 0.85, 0.5 * 0.7]
    assert shown.tolist() == [[round(share * c) for c in (100.0, 200.0, 250.0)] for share in shares]
    bright = shade(Appearance(ambient=2.0), color[:1], normals[:1], True)
    assert bright.tolist() == [[200, 255, 255]]


@pytest.mark.parametrize(
    ("pattern", "cells"),
    [
        (Pattern.STRIPES, {(0.1, 0.0): 0, (0.6, 0.0): 1, (1.1, 5.0): 0, (-0.1, 0.0): 1, (0.1, 0.7): 0}),
        (Pattern.CHECKS, {(0.5, 0.5): 0, (1.5, 0.5): 1, (0.5, 1.5): 1, (1.5, 1.5): 0, (-0.5, 0.5): 1}),
    ],
)
@pytest.mark.parametrize("angle", [0.0, 0.5])
def test_a_pattern_alternates_in_its_period(pattern: Pattern, cells, angle: float) -> None:
    texture = TableTexture(pattern, (10.0, 20.0, 30.0), 0.05, angle)
    c, s = math.cos(angle), math.sin(angle)
    places = np.array([(0.05 * (c * u - s * v), 0.05 * (s * u + c * v), 0.0) for u, v in cells], np.float32)
    found = texture.colors(places, (110.0, 120.0, 130.0))
    assert found.tolist() == [[10.0, 20.0, 30.0] if share else [110.0, 120.0, 130.0] for share in cells.values()]


def test_speckles_are_the_lattices_numbers_and_between_them_a_mixture() -> None:
    texture, lattice = TableTexture(Pattern.SPECKLE, (1.0, 1.0, 1.0), 1.0, seed=3), _lattice(3)
    places = np.array([(2, 5, 0), (2.5, 5, 0), (2, 5.25, 0), (2 + 64, 5 - 64, 0), (63.5, 5, 0)], np.float32)
    a, right, above = float(lattice[2, 5]), float(lattice[3, 5]), float(lattice[2, 6])
    wanted = [a, (a + right) / 2, 0.75 * a + 0.25 * above, a, float(lattice[63, 5] + lattice[0, 5]) / 2]
    assert texture.colors(places, (0.0, 0.0, 0.0))[:, 0] == pytest.approx(wanted, abs=1e-5)
    assert (_lattice(3) != _lattice(4)).any() and 0.0 <= lattice.min() < 0.01 and 0.99 < lattice.max() < 1.0


def test_grain_runs_across_its_angle_and_is_bent_a_little() -> None:
    texture = TableTexture(Pattern.GRAIN, (1.0, 1.0, 1.0), 1.0, seed=1)
    line = np.zeros((400, 3), np.float32)
    line[:, 0] = np.linspace(0.0, 20.0, 400)
    waves = texture.colors(line, (0.0, 0.0, 0.0))[:, 0]
    assert waves.min() < 0.01 and waves.max() > 0.99
    rises = np.count_nonzero((waves[:-1] < 0.5) & (waves[1:] >= 0.5))
    assert 16 <= rises <= 24, "about one a period"
    noise = texture._noise(0.3 * line[:, 0], 0.0 * line[:, 0])
    assert waves == pytest.approx(0.5 + 0.5 * np.sin(2 * np.pi * (line[:, 0] + 1.5 * noise)), abs=1e-4)


def test_looks_are_drawn_from_all_of_their_ranges() -> None:
    rng, ranges = np.random.default_rng(0), AppearanceRanges()
    looks = [random_appearance(rng) for _ in range(400)]
    brightness = [look.ambient + look.diffuse * math.sin(look.light_elevation) for look in looks]
    shares = [1.0 - look.ambient / level for look, level in zip(looks, brightness, strict=True)]
    greys = [float(np.mean(look.table_rgb)) for look in looks]
    for values, (low, high) in (
        (brightness, (0.88, 1.1)),
        (shares, (0.3, 0.6)),
        ([math.degrees(look.light_elevation) for look in looks], (45.0, 82.0)),
        ([look.light_azimuth for look in looks], (-math.pi, math.pi)),
        (greys, (45.0 - 8.0, 105.0 + 8.0)),
    ):
        margin = 0.12 * (high - low)
        assert low - 1e-9 <= min(values) < low + margin and high - margin < max(values) <= high + 1e-9
    assert 6.0 < max(np.ptp(look.table_rgb) for look in looks) <= 16.0
    exposures = [random_light(Appearance(), rng) for _ in range(200)]
    levels = [look.ambient + look.diffuse * math.sin(look.light_elevation) for look in exposures]
    assert 0.8 * 0.88 <= min(levels) < 0.8 and 1.18 < max(levels) <= 1.2 * 1.1
    assert all(look.table_rgb == Appearance().table_rgb and look.table_texture is None for look in exposures)
    tables = [random_table(Appearance(), rng) for _ in range(200)]
    textures = [look.table_texture for look in tables]
    contrasts = [np.abs(np.subtract(look.table_rgb, look.table_texture.rgb)).max() for look in tables]  # type: ignore[union-attr]
    assert 6.0 <= min(contrasts) < 13.0 and 35.0 < max(contrasts) <= 40.0
    periods = [texture.period for texture in textures if texture is not None]
    assert (ranges.texture_period[0], 0.12) == (0.02, 0.12) and 0.02 <= min(periods) < 0.025 < 0.115 < max(periods)
    assert {texture.pattern for texture in textures if texture} == set(Pattern)
    assert all(look.light_azimuth == Appearance().light_azimuth for look in tables)


def test_palettes_share_three_colours_and_browns_are_darker_or_lighter() -> None:
    assert set(SEEN_PALETTE) & set(UNSEEN_PALETTE) == {"blue", "red", "green"}
    assert set(SEEN_PALETTE) | set(UNSEEN_PALETTE) == set(COLORS)
    shades = [random_brown(np.random.default_rng(seed))[0] / COLORS["brown"][0] for seed in range(100)]
    assert 0.49 < min(shades) < 0.55 and 1.45 < max(shades) < 1.51


def test_the_backdrop_is_a_table_over_a_floor() -> None:
    mesh, look = backdrop_mesh(), Appearance()
    corners = mesh.vertices[mesh.triangles]
    table, floor = corners[:TABLE_TRIANGLES].reshape(-1, 3), corners[TABLE_TRIANGLES:].reshape(-1, 3)
    assert table.min(axis=0) == pytest.approx([-0.3, -0.65, -0.03]) and table.max(axis=0) == pytest.approx(
        [0.85, 0.65, 0.0], abs=1e-7
    )
    assert floor.min(axis=0) == pytest.approx([-4.0, -4.0, -0.755]) and floor[:, 2].max() == pytest.approx(-0.745)
    colors = backdrop_colors(look)
    assert (colors[:12] == look.table_rgb).all() and (colors[12:] == look.floor_rgb).all() and len(colors) == 24


def test_a_window_sees_the_workspace_up_to_twelve_centimetres() -> None:
    lens = CameraModel(2000, 1600, 1000.0, 1000.0, 1000.0, 800.0)
    half_x, half_y = 200.0 / 0.88, 400.0 / 0.88
    wanted = [800 - half_x - 12, 800 + half_x + 12, 1000 - half_y - 12, 1000 + half_y + 12]
    window = ImageWindow.around_workspace(lens, DOWN, WorkspaceSpec())
    found = [window.row_start, window.row_end, window.col_start, window.col_end]
    assert found == [math.floor(wanted[0]), math.ceil(wanted[1]), math.floor(wanted[2]), math.ceil(wanted[3])]
    low = ImageWindow.around_workspace(lens, DOWN, WorkspaceSpec(), top=0.0, border=0)
    assert (low.row_start, low.row_end, low.col_start, low.col_end) == (600, 1000, 600, 1400)
    small = CameraModel(200, 100, 1000.0, 1000.0, 100.0, 50.0)
    assert ImageWindow.around_workspace(small, DOWN, WorkspaceSpec()) == ImageWindow.whole(small)
    assert window.slices == (slice(found[0], found[1]), slice(found[2], found[3]))


def test_shadows_fall_away_from_the_light() -> None:
    light = np.array([0.6, 0.0, 0.8], np.float32)
    points = np.array([(0.1, 0.2, 0.4), (0.0, 0.0, 0.0)], np.float32)
    assert along_light(points, light, 0.0) == pytest.approx(np.array([(-0.2, 0.2, 0.0), (0.0, 0.0, 0.0)]), abs=1e-6)
    assert along_light(points[:1], light, 0.2)[0] == pytest.approx([-0.05, 0.2, 0.2], abs=1e-6)


def _square(x: float, y: float, half: float) -> np.ndarray:
    return np.array([(x + a * half, y + b * half, 0.0) for a in (-1, 1) for b in (-1, 1)], np.float32)


def test_a_silhouette_is_its_pixels_and_one_around_them() -> None:
    view = View(CAMERA, ImageWindow(10, 90, 20, 100), DOWN)
    mask = view.silhouettes([_square(0.45, 0.0, 0.1), _square(0.65, 0.3, 0.02)])
    assert mask.shape == (80, 80) and not view.silhouettes([]).any()
    rows, cols = np.nonzero(mask[:, 20:])
    assert (rows.min(), rows.max(), cols.min() + 20, cols.max() + 20) == (29, 51, 29, 51)
    rows, cols = np.nonzero(mask[:, :20])
    assert (rows.min(), rows.max(), cols.min(), cols.max()) == (17, 23, 7, 13)
    behind = _square(0.45, 0.0, 0.1) + np.array([0.0, 0.0, 0.99], np.float32)
    assert view.silhouettes([behind]).all(), "an outline behind the camera is none"


@pytest.mark.parametrize(
    ("x", "y", "seen"),
    [
        (0.45, 0.0, True),
        (0.98, 0.0, False),
        (0.96, 0.0, True),
        (0.45, -0.63, False),
        (0.45, -0.59, True),
        (0.45, 0.63, False),
    ],
)
def test_what_lies_beside_the_picture_is_not_seen(x: float, y: float, seen: bool) -> None:
    view = View(CAMERA, ImageWindow.whole(CAMERA), DOWN)
    assert view.may_see(_square(x, y, 0.01)[None]).tolist() == [seen]


def test_rays_and_their_sums() -> None:
    directions = np.array([(0, 0, -1), (3, 0, -4), (0, 0, 1)], np.float32)
    rays = Rays(np.array([1, 2, 3], np.float32), directions, np.array([1, 5, 1], np.float32))
    assert rays.points(np.array([2, 1, 1], np.float32)).tolist() == [[1, 2, 1], [4, 2, -1], [1, 2, 4]]
    up = np.tile(np.array([(0, 0, 1)], np.float32), (3, 1))
    assert rays.facing(up) == pytest.approx([1.0, 0.8, 1.0])
    assert rays.take(np.array([1])).lengths.tolist() == [5.0]
    assert dot(np.array([(1, 2, 3)], np.float32), np.array([4, 5, 6], np.float32)).tolist() == [32.0]
    quarter = np.array([(0, -1, 0), (1, 0, 0), (0, 0, 1)], np.float32)
    assert turned(np.array([(1, 2, 3)], np.float32), quarter).tolist() == [[-2, 1, 3]]
    assert len(turned(np.zeros((0, 3), np.float32), quarter)) == 0


def test_sensors_of_a_kind_have_their_imperfections() -> None:
    """Each kind's own: what it does not say is the plain one's."""
    plain, perfect = NoiseConfig.of_kind(SensorKind.PLAIN), NoiseConfig.none()
    assert plain == NoiseConfig() and (perfect.color_sigma, perfect.loss, perfect.bias) == (0.0, 0.0, 0.0)
    kinds = {kind: NoiseConfig.of_kind(kind) for kind in SensorKind}
    assert kinds.pop(SensorKind.PERFECT) == perfect
    assert [kinds[kind].flying for kind in kinds] == [0.0, 0.0, 0.5, 0.0]
    assert [kinds[kind].depth_sigma for kind in kinds] == [0.0015, 0.0015, 0.0012, 0.0025]
    assert [kinds[kind].step for kind in kinds] == [0.0, 0.0028, 0.0, 0.0015]
    assert [kinds[kind].bias for kind in kinds] == [0.0, 0.002, 0.003, 0.002]
    assert [kinds[kind].edge_loss for kind in kinds] == [0.7, 0.9, 0.4, 0.8]
    assert [kinds[kind].dark_loss for kind in kinds] == [0.0, 0.6, 0.5, 0.0]
    assert [kinds[kind].gloss_loss for kind in kinds] == [0.0, 0.6, 0.5, 0.3]
    assert [kinds[kind].tick for kind in kinds] == [0.0, 0.0, 0.001, 0.0]


def _flat(depth: float = 1.0) -> CleanFrame:
    shape = (200, 200)
    return CleanFrame(
        np.full((*shape, 3), 120, np.uint8), np.full(shape, depth, np.float32), np.ones(shape, np.float32)
    )


def test_noise_has_the_size_that_it_is_told() -> None:
    rng = np.random.default_rng(0)
    color, depth = with_noise(_flat(2.0), NoiseConfig(4.0, 0.002, np.inf, 0.0, 0.15, 0.1), rng)
    assert color.std() == pytest.approx(4.0, rel=0.03) and color.mean() == pytest.approx(120.0, abs=0.1)
    assert np.isnan(depth).mean() == pytest.approx(0.1, abs=0.01)
    known = depth[np.isfinite(depth)]
    assert known.std() == pytest.approx(4 * 0.002, rel=0.03) and known.mean() == pytest.approx(2.0, abs=2e-4)
    clean = _flat()
    clean.depth[:, 100:], clean.depth[0, 0], clean.facing[5, 5] = 0.97, np.inf, 0.14
    _, lossy = with_noise(clean, NoiseConfig(0.0, 0.0, 0.02, 0.6, 0.15, 0.0), rng)
    lost = np.isnan(lossy)
    assert lost[:, 99:101].mean() == pytest.approx(0.6, abs=0.08) and lost[0, 0] and lost[5, 5]
    lost[:, 99:101] = lost[0, 0] = lost[5, 5] = False
    assert lost.sum() <= 2, "beside the pixel without depth"
    _, perfect = with_noise(clean, NoiseConfig.none(), rng)
    assert np.isnan(perfect[0, 0]) and perfect[5, 5] == 1.0 and np.isnan(perfect).sum() == 1


def test_biased_and_stepped_depth() -> None:
    rng = np.random.default_rng(0)
    off = NoiseConfig(0.0, 0.0, np.inf, 0.0, 0.0, 0.0, bias=0.01)
    assert with_noise(_flat(2.0), off, rng)[1][0, 0] == pytest.approx(2.04)
    stepped = NoiseConfig(0.0, 0.0, np.inf, 0.0, 0.0, 0.0, step=0.01)
    assert with_noise(_flat(1.003), stepped, rng)[1][0, 0] == pytest.approx(1.0), "a hundredth part of 100"
    assert with_noise(_flat(1.006), stepped, rng)[1][0, 0] == pytest.approx(1.0 / 0.99)
    dark = NoiseConfig(0.0, 0.0, np.inf, 0.0, 0.0, 0.0, dark_level=121.0, dark_loss=0.25)
    assert np.isnan(with_noise(_flat(), dark, rng)[1]).mean() == pytest.approx(0.25, abs=0.02)
