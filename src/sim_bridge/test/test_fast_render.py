"""The renderer casts rays only where bodies can show: its pictures equal those of a plain cast of every ray.

Tolerance: colours the same and depth within 1e-5 m, but for less than 0.01 % of the pixels.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt
import open3d.core as o3c
import pytest
from open3d.t.geometry import RaycastingScene

from cliport_core import Pose
from cliport_perception import CameraModel
from sim_bridge.geometry.mesh import TriangleMesh
from sim_bridge.rendering import backdrop_view
from sim_bridge.rendering.appearance import Appearance, random_appearance, random_light, random_table
from sim_bridge.rendering.backdrop import TABLE_TRIANGLES, backdrop_mesh
from sim_bridge.rendering.camera import default_intrinsics
from sim_bridge.rendering.image_window import ImageWindow
from sim_bridge.rendering.mounting import load_mounting, mounting_error
from sim_bridge.rendering.panda_meshes import panda_meshes
from sim_bridge.rendering.rays import Rays
from sim_bridge.rendering.renderer import Renderer
from sim_bridge.rendering.table_texture import Pattern, TableTexture
from sim_bridge.rendering.visible import Visible
from sim_bridge.scene import reset_scene
from sim_bridge.world import SimWorld

CAMERA = default_intrinsics()
TASK = "put-blocks-in-bowls-seen-colors"


@dataclass(frozen=True, eq=False)
class Thing:
    mesh: TriangleMesh
    pose: Pose
    rgb: tuple[int, int, int] = (200, 100, 50)


@dataclass(frozen=True)
class NoArm:
    link_indices: dict[str, int] = field(default_factory=lambda: dict.fromkeys(panda_meshes(), 0))

    def link_pose(self, link: int) -> Pose:
        return Pose(np.eye(3), np.array([0.0, 0.0, -5.0]))


@dataclass(frozen=True)
class Still:
    """A world of things that stand in the air."""

    objects: tuple[Thing, ...]
    time: float = 0.0
    panda: NoArm = field(default_factory=NoArm)

    def object_pose(self, thing: Thing) -> Pose:
        return thing.pose


def plain(
    world: Visible, camera: CameraModel, pose: Pose, look: Appearance
) -> tuple[npt.NDArray[np.uint8], npt.NDArray[np.float32]]:
    """Colour and depth by casting a ray a pixel at all there is, and a second one from there to the light."""
    items = [(o.mesh, world.object_pose(o), o.rgb) for o in world.objects]
    for link, mesh in panda_meshes().items():
        index = -1 if link == "panda_link0" else world.panda.link_indices[link]
        items.append((mesh, world.panda.link_pose(index), look.robot_rgb))
    room = backdrop_mesh()
    corners = [room.vertices[room.triangles]] + [
        p.apply(m.vertices).astype(np.float32)[m.triangles] for m, p, _ in items
    ]
    soup = np.concatenate(corners)  # (M, 3 corners, xyz)
    n_floor = len(room.triangles) - TABLE_TRIANGLES
    own = [np.tile(look.table_rgb, (TABLE_TRIANGLES, 1)), np.tile(look.floor_rgb, (n_floor, 1))]
    own += [np.tile(rgb, (len(m.triangles), 1)) if m.colors is None else m.colors for m, _, rgb in items]
    normals = np.cross(soup[:, 1] - soup[:, 0], soup[:, 2] - soup[:, 0]).astype(np.float64)
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    scene = RaycastingScene()
    indices = np.arange(3 * len(soup), dtype=np.uint32).reshape(-1, 3)
    scene.add_triangles(o3c.Tensor.from_numpy(soup.reshape(-1, 3)), o3c.Tensor.from_numpy(indices))
    directions = camera.rays().reshape(-1, 3) @ pose.rotation.T
    origins = np.broadcast_to(pose.translation, directions.shape)
    hits = scene.cast_rays(o3c.Tensor.from_numpy(np.hstack([origins, directions]).astype(np.float32)))
    depth, triangle = hits["t_hit"].numpy(), hits["primitive_ids"].numpy().astype(int)
    seen = np.isfinite(depth)
    triangle[~seen] = 0
    probes = origins + directions * np.where(seen, depth, 0.0)[:, None] + 5e-4 * normals[triangle]
    towards = np.broadcast_to(look.to_light, probes.shape)
    dark = scene.test_occlusions(o3c.Tensor.from_numpy(np.hstack([probes, towards]).astype(np.float32))).numpy()
    cosine = np.where(dark, 0.0, np.clip(normals @ look.to_light, 0.0, None)[triangle])
    share = look.ambient * (0.85 + 0.15 * normals[triangle, 2]) + look.diffuse * cosine
    shown = np.concatenate(own)[triangle]
    if look.table_texture is not None:
        on_table = triangle < TABLE_TRIANGLES
        points = origins + directions * np.where(seen, depth, 0.0)[:, None]
        shown[on_table] = look.table_colors(points[on_table].astype(np.float32))
    color = shown * share[:, None]
    color[~seen] = np.array(look.floor_rgb) * look.ambient * 0.85
    shape = (camera.height, camera.width)
    return np.clip(np.rint(color), 0, 255).astype(np.uint8).reshape(*shape, 3), depth.reshape(shape)


def assert_fast_equals_plain(world: Visible, pose: Pose, look: Appearance, camera: CameraModel = CAMERA) -> None:
    frame = Renderer(camera, ImageWindow.whole(camera)).render(world, pose, look)
    color, depth = plain(world, camera, pose, look)
    nothing = np.isinf(depth) & np.isinf(frame.depth)
    off = np.abs(np.where(nothing, 0.0, frame.depth) - np.where(nothing, 0.0, depth)) > 1e-5
    off |= (frame.color != color).any(axis=-1)
    assert off.mean() < 1e-4


@pytest.fixture(scope="module")
def world() -> Iterator[SimWorld]:
    world = SimWorld()
    yield world
    world.close()


@pytest.mark.parametrize("seed", range(3))
def test_scenes_of_a_task_in_the_default_and_in_random_looks(world: SimWorld, seed: int) -> None:
    reset_scene(world, TASK, "val", seed)
    rng = np.random.default_rng(seed)
    assert_fast_equals_plain(world, load_mounting(), Appearance())
    assert_fast_equals_plain(world, mounting_error(load_mounting(), rng), random_appearance(rng))


def test_the_arm_in_view_and_its_shadow(world: SimWorld) -> None:
    reset_scene(world, TASK, "val", 0)
    positions = np.add(world.panda.state().positions, (0.2, 0.6, 0.1, 0.3, 0.0, 0.0, 0.0))
    world.panda.command(positions, np.zeros(7))
    for _ in range(240):
        world.step()
    rng = np.random.default_rng(1)
    for look in (Appearance(), random_appearance(rng), random_appearance(rng)):
        assert_fast_equals_plain(world, load_mounting(), look)


def turned(x: float, y: float, z: float, roll: float = 0.0, pitch: float = 0.0) -> Pose:
    return Pose.from_xyz_rpy((x, y, z), (roll, pitch, 0.7))


def test_things_at_edges_in_the_air_below_the_table_and_before_the_lens() -> None:
    ring = [(0.05 * np.cos(a), 0.05 * np.sin(a)) for a in np.linspace(0.0, 6.0, 20)]
    hollow = TriangleMesh.extruded(ring, 0.03, [0.6 * np.array(ring)])
    box = TriangleMesh.box((0.2, 0.02, 0.1))
    things = (
        Thing(hollow, turned(0.45, 0.0, 0.1, 0.4, 0.3)),
        Thing(box, turned(0.85, 0.3, 0.02)),  # over the table's edge: its shadow falls on the floor
        Thing(box, turned(1.1, -0.3, -0.3)),  # on its way down
        Thing(TriangleMesh.joined([box.colored((9, 200, 9)), hollow.colored((9, 9, 200))]), turned(0.5, 0.45, 0.05)),
    )
    rng = np.random.default_rng(2)
    for look in (Appearance(), random_appearance(rng), Appearance(light_elevation=0.2)):
        assert_fast_equals_plain(Still(things), load_mounting(), look)
    before_the_lens = (*things, Thing(box, load_mounting()))
    assert_fast_equals_plain(Still(before_the_lens), load_mounting(), Appearance())
    from_the_side = Pose.looking_at((0.4, 1.0, 0.2), (0.4, 0.0, 0.3))  # the floor's end and the void beyond it
    assert_fast_equals_plain(Still(things), from_the_side, Appearance())


def test_the_tables_top_needs_no_rays() -> None:
    directions = np.array([[0.0, 0.0, -1.0], [0.2, 0.1, -1.0], [3.0, 0.0, -1.0], [0.0, 3.0, -1.0], [0.1, 0.0, 1.0]])
    rays = Rays(np.array([0.5, 0.0, 0.8], np.float32), directions.astype(np.float32), np.ones(5, np.float32))
    depth, is_top = backdrop_view._table_top(rays)
    assert is_top.tolist() == [True, True, False, False, False]
    assert depth[:2] == pytest.approx([0.8, 0.8])


def test_a_distorting_lens_and_an_empty_table() -> None:
    camera = CameraModel(240, 136, 135.0, 135.0, 120.0, 68.0, "plumb_bob", (-0.2, 0.05, 0.0, 0.0, 0.0))
    block = Thing(TriangleMesh.box((0.1, 0.1, 0.1)), turned(0.45, 0.1, 0.05))
    assert_fast_equals_plain(Still((block,)), load_mounting(), Appearance(), camera)
    assert_fast_equals_plain(Still(()), load_mounting(), Appearance())


def test_the_picture_depends_neither_on_threads_nor_on_what_was_rendered_before(world: SimWorld) -> None:
    reset_scene(world, TASK, "val", 3)
    rng = np.random.default_rng(3)
    looks = [(mounting_error(load_mounting(), rng), random_appearance(rng)) for _ in range(2)]
    one, many = (Renderer(CAMERA, ImageWindow.whole(CAMERA), n_threads=n) for n in (1, 0))
    for pose, look in (*looks, looks[0]):
        fresh = Renderer(CAMERA, ImageWindow.whole(CAMERA), n_threads=2).render(world, pose, look)
        for renderer in (one, many):
            frame = renderer.render(world, pose, look)
            assert frame.color.tobytes() == fresh.color.tobytes()
            assert frame.depth.tobytes() == fresh.depth.tobytes()
            assert frame.facing.tobytes() == fresh.facing.tobytes()


def test_a_texture_lies_where_its_coordinates_say() -> None:
    vertices = np.array([[-0.1, -0.1, 0], [0.1, -0.1, 0], [0.1, 0.1, 0], [-0.1, 0.1, 0]], dtype=np.float32)
    triangles = np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32)
    place_in_image = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], dtype=np.float32)  # u along x, v along y
    image = np.array([[[255, 0, 0], [0, 255, 0]], [[0, 0, 255], [200, 200, 0]]], dtype=np.uint8)
    sheet = TriangleMesh(vertices, triangles, uv=place_in_image[triangles], texture=image)
    bare = TriangleMesh.joined([sheet, TriangleMesh.box((0.04, 0.04, 0.04)).colored((10, 20, 30))])
    world = Still((Thing(bare, Pose.from_xyz_rpy((0.45, 0.0, 0.01), (0.0, 0.0, 0.0))),))
    look = Appearance(ambient=1.0, diffuse=0.0)
    pose = load_mounting()
    frame = Renderer(CAMERA, ImageWindow.whole(CAMERA)).render(world, pose, look)

    def shown(x: float, y: float, z: float = 0.01) -> list[int]:
        row, col = np.rint(CAMERA.project(pose.inverse().apply([[x, y, z]]))[0]).astype(int)
        return frame.color[row, col].tolist()

    assert shown(0.40, 0.05) == [255, 0, 0]  # upper left in the image: small u, large v
    assert shown(0.50, 0.05) == [0, 255, 0]
    assert shown(0.40, -0.05) == [0, 0, 255]
    assert shown(0.50, -0.05) == [200, 200, 0]
    assert shown(0.45, 0.0, 0.03) == [10, 20, 30]


@pytest.mark.parametrize("pattern", list(Pattern))
def test_patterns_on_the_table_are_seen_alike_in_light_and_shadow(world: SimWorld, pattern: Pattern) -> None:
    reset_scene(world, TASK, "test", 1)
    look = Appearance(table_texture=TableTexture(pattern, (120.0, 96.0, 60.0), 0.08, 0.4, seed=3))
    assert_fast_equals_plain(world, load_mounting(), look)


def test_light_and_table_are_drawn_apart() -> None:
    lit = random_light(Appearance(), np.random.default_rng(0))
    laid = random_table(Appearance(), np.random.default_rng(0))
    assert lit.table_rgb == Appearance().table_rgb and lit.table_texture is None and lit.diffuse != Appearance().diffuse
    assert laid.to_light == Appearance().to_light and laid.diffuse == Appearance().diffuse
    assert laid.table_texture is not None and max(abs(np.subtract(laid.table_texture.rgb, laid.table_rgb))) > 5.0
