"""The camera: depth and colour against what geometry says, shadows, noise, determinism."""

from collections.abc import Iterator

import numpy as np
import pytest

from cliport_perception import CameraModel, Pose, WorkspaceSpec, heightmap_from_rgbd
from sim_bridge.appearance import Appearance, random_appearance
from sim_bridge.camera import CameraConfig, NoiseConfig, SimCamera, default_camera_in_base, mounting_error
from sim_bridge.colors import COLORS
from sim_bridge.image_window import ImageWindow
from sim_bridge.mesh import TriangleMesh
from sim_bridge.objects import BOWL_HEIGHT, BOWL_RADIUS, bowl_mesh
from sim_bridge.renderer import Renderer
from sim_bridge.world import SimWorld

SMALL = CameraModel(240, 136, 135.0, 135.0, 120.0, 68.0)


@pytest.fixture
def world() -> Iterator[SimWorld]:
    world = SimWorld()
    yield world
    world.close()


def test_depth_of_the_table_and_of_a_block_is_analytic(world: SimWorld) -> None:
    world.add_block("red", 0.45, 0.1, 0.0)
    pose = default_camera_in_base()
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
        world.add_block(name, x, y, 0.0)
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
    pose = default_camera_in_base()
    renderer = Renderer(SMALL, ImageWindow.whole(SMALL))
    empty = renderer.render(world, pose, look)
    world.add_bowl("green", 0.45, 0.0, 0.0, fixed=True)
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
    world.add_bowl("pink", 0.5, -0.2, 0.0, fixed=True)
    pose = default_camera_in_base()
    window = ImageWindow(30, 100, 50, 200)
    whole = Renderer(SMALL, ImageWindow.whole(SMALL)).render(world, pose, Appearance())
    part = Renderer(SMALL, window, n_threads=1).render(world, pose, Appearance())
    np.testing.assert_array_equal(part.color, whole.color[window.slices])
    np.testing.assert_array_equal(part.depth, whole.depth[window.slices])


def test_same_generator_gives_the_same_noisy_frame_and_noise_is_as_told(world: SimWorld) -> None:
    world.add_bowl("blue", 0.45, 0.2, 0.0, fixed=True)
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
        moved = default_camera_in_base().inverse() @ mounting_error(default_camera_in_base(), rng)
        assert np.linalg.norm(moved.translation) < 0.01
        assert np.arccos(np.clip((np.trace(moved.rotation) - 1) / 2, -1, 1)) < 0.01
    assert isinstance(mounting_error(Pose.identity(), rng), Pose)


@pytest.mark.parametrize("mesh", [TriangleMesh.box((0.1, 0.2, 0.3)), bowl_mesh()])
def test_meshes_are_closed_and_face_outwards(mesh: TriangleMesh) -> None:
    edges: dict[tuple[int, int], int] = {}
    for triangle in mesh.triangles.tolist():
        for i in range(3):
            edge = (triangle[i], triangle[(i + 1) % 3])
            edges[edge] = edges.get(edge, 0) + 1
    assert all(count == 1 and edges.get(edge[::-1]) == 1 for edge, count in edges.items())
    a, b, c = (mesh.vertices[mesh.triangles[:, i]].astype(float) for i in range(3))
    volume = np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6.0
    assert volume > 0.0


def test_bowl_has_the_specified_size_about_its_middle() -> None:
    vertices = bowl_mesh().vertices
    assert np.linalg.norm(vertices[:, :2], axis=1).max() == pytest.approx(BOWL_RADIUS, abs=1e-6)
    assert vertices[:, 2].min() == pytest.approx(-BOWL_HEIGHT / 2)
    assert vertices[:, 2].max() == pytest.approx(BOWL_HEIGHT / 2)
    np.testing.assert_allclose(vertices[:, :2].mean(axis=0), 0.0, atol=1e-6)
