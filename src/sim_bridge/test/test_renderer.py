"""The camera: depth and colour against what geometry says, shadows, noise, determinism."""

from collections.abc import Iterator

import numpy as np
import pytest

from cliport_core import PlanarPose, Pose, WorkspaceSpec
from cliport_perception import CameraModel, heightmap_from_rgbd
from sim_bridge.colors import COLORS
from sim_bridge.errors import SimulationError
from sim_bridge.objects import block_shape, bowl_shape
from sim_bridge.rendering.appearance import Appearance, AppearanceRanges, random_appearance
from sim_bridge.rendering.camera import CameraConfig, SimCamera
from sim_bridge.rendering.image_window import ImageWindow
from sim_bridge.rendering.mounting import load_mounting, mounting_error
from sim_bridge.rendering.renderer import Renderer
from sim_bridge.rendering.sensor_noise import NoiseConfig
from sim_bridge.world import SimWorld

SMALL = CameraModel(240, 136, 135.0, 135.0, 120.0, 68.0)


@pytest.fixture
def world() -> Iterator[SimWorld]:
    world = SimWorld()
    yield world
    world.close()


def add_block(world: SimWorld, color: str, x: float, y: float) -> None:
    world.add(block_shape(), PlanarPose(x, y, 0.0).as_pose(0.02), color)


def add_bowl(world: SimWorld, color: str, x: float, y: float) -> None:
    world.add(bowl_shape(), PlanarPose(x, y, 0.0).as_pose(0.0175), color, fixed=True)


def test_depth_of_the_table_and_of_a_block_is_analytic(world: SimWorld) -> None:
    add_block(world, "red", 0.45, 0.1)
    pose = load_mounting()
    frame = Renderer(SMALL, ImageWindow.whole(SMALL)).render(world, pose, Appearance())
    points = pose.apply(SMALL.rays() * np.where(np.isfinite(frame.depth), frame.depth, 0.0)[..., None])
    on_table = (points[..., 0] > 0.3) & (points[..., 0] < 0.6) & (points[..., 1] > -0.4) & (points[..., 1] < 0.0)
    assert on_table.sum() > 500
    np.testing.assert_allclose(points[on_table][:, 2], 0.0, atol=1e-5)
    on_top = (abs(points[..., 0] - 0.45) < 0.018) & (abs(points[..., 1] - 0.1) < 0.018) & (points[..., 2] > 0.03)
    assert on_top.sum() > 5
    np.testing.assert_allclose(points[on_top][:, 2], 0.04, atol=1e-4)


def test_level_surfaces_show_the_palettes_colours(world: SimWorld) -> None:
    places = [(0.3 + 0.1 * (i % 4), -0.3 + 0.25 * (i // 4)) for i in range(len(COLORS))]
    for (name, _), (x, y) in zip(COLORS.items(), places, strict=True):
        add_block(world, name, x, y)
    camera = SimCamera(CameraConfig(noise=NoiseConfig.none()))
    frame = camera.capture(world, np.random.default_rng(0))
    spec = WorkspaceSpec()
    view = heightmap_from_rgbd(frame.color, frame.depth, camera.intrinsics, camera.camera_in_base, spec)
    seen = np.array([view.color[spec.xy_to_pixel(x, y)] for x, y in places], dtype=float)
    wanted = np.array(list(COLORS.values()), dtype=float)
    assert abs(seen - wanted).max() < 12
    nearest = ((seen[:, None] - wanted[None]) ** 2).sum(axis=-1).argmin(axis=1)
    assert nearest.tolist() == list(range(len(COLORS)))
    heights = [view.height[spec.xy_to_pixel(x, y)] for x, y in places]
    np.testing.assert_allclose(heights, 0.04, atol=1e-3)


def test_arm_at_home_is_not_in_the_heightmap_and_the_workspace_is_seen(world: SimWorld) -> None:
    camera = SimCamera()
    frame = camera.capture(world, np.random.default_rng(0))
    view = heightmap_from_rgbd(frame.color, frame.depth, camera.intrinsics, camera.camera_in_base, WorkspaceSpec())
    assert view.valid_fraction > 0.99
    assert view.height.max() < 0.012


def test_shadow_darkens_the_table_behind_a_bowl(world: SimWorld) -> None:
    look = Appearance()
    pose = load_mounting()
    renderer = Renderer(SMALL, ImageWindow.whole(SMALL))
    empty = renderer.render(world, pose, look)
    add_bowl(world, "green", 0.45, 0.0)
    full = renderer.render(world, pose, look)
    same_surface = abs(full.depth - empty.depth) < 1e-6
    darker = full.color.astype(int).sum(-1) < 0.75 * empty.color.astype(int).sum(-1)
    points = pose.apply(SMALL.rays() * np.where(same_surface, full.depth, 0.0)[..., None])
    shadowed = points[same_surface & darker]
    assert len(shadowed) > 10
    away = -np.array(look.to_light[:2])
    offset = (shadowed[:, :2] - (0.45, 0.0)) @ (away / np.linalg.norm(away))
    assert (offset > 0.0).mean() > 0.9


def test_window_equals_the_same_part_of_the_whole_image(world: SimWorld) -> None:
    add_bowl(world, "pink", 0.5, -0.2)
    pose = load_mounting()
    window = ImageWindow(30, 100, 50, 200)
    whole = Renderer(SMALL, ImageWindow.whole(SMALL)).render(world, pose, Appearance())
    part = Renderer(SMALL, window, n_threads=1).render(world, pose, Appearance())
    np.testing.assert_array_equal(part.color, whole.color[window.slices])
    np.testing.assert_array_equal(part.depth, whole.depth[window.slices])


def test_same_generator_gives_the_same_noisy_frame_and_noise_is_as_told(world: SimWorld) -> None:
    add_bowl(world, "blue", 0.45, 0.2)
    camera = SimCamera(CameraConfig(intrinsics=SMALL))
    clean = SimCamera(CameraConfig(intrinsics=SMALL, noise=NoiseConfig.none()))
    first, second = (camera.capture(world, np.random.default_rng(3)) for _ in range(2))
    np.testing.assert_array_equal(first.color, second.color)
    np.testing.assert_array_equal(first.depth, second.depth)
    other = camera.capture(world, np.random.default_rng(4))
    assert (other.color != first.color).any()
    truth = clean.capture(world, np.random.default_rng(0))
    scaled = (first.depth - truth.depth) / truth.depth**2
    assert np.nanstd(scaled) == pytest.approx(0.0015, rel=0.1)
    lost = np.isnan(first.depth) & ~np.isnan(truth.depth)
    assert 0.002 < lost.mean() < 0.2
    shade = first.color.astype(float) - truth.color
    assert shade[truth.color.min(axis=-1) > 20].std() == pytest.approx(3.0, rel=0.15)


def test_random_looks_keep_level_surfaces_bright_enough_and_errors_small() -> None:
    rng = np.random.default_rng(0)
    for _ in range(50):
        look = random_appearance(rng)
        level = look.ambient + look.diffuse * look.to_light[2]
        assert 0.85 < level < 1.15 and np.linalg.norm(look.to_light) == pytest.approx(1.0)
        moved = load_mounting().inverse() @ mounting_error(load_mounting(), rng)
        assert np.linalg.norm(moved.translation) < 0.01
        assert np.arccos(np.clip((np.trace(moved.rotation) - 1) / 2, -1, 1)) < 0.01
    assert isinstance(mounting_error(Pose.identity(), rng), Pose)


def test_ranges_of_looks_are_parameters_and_a_light_below_the_table_is_refused() -> None:
    ranges = AppearanceRanges(light_elevation=(1.2, 1.3), table_grey=(60.0, 60.0), table_tint=0.0)
    look = random_appearance(np.random.default_rng(0), ranges)
    assert 1.2 <= look.light_elevation <= 1.3 and look.table_rgb == (60.0, 60.0, 60.0)
    with pytest.raises(SimulationError, match=r"elevation of -5\.7 degrees: give one from 5 to 90"):
        Appearance(light_elevation=-0.1)
