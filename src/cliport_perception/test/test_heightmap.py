from __future__ import annotations

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import pytest

from cliport_core import ImageError, Pose, WorkspaceSpec
from cliport_core.heightmap import Heightmap
from cliport_perception import CameraModel, HeightmapBuilder, heightmap_from_rgbd

WORKSPACE = WorkspaceSpec()


def build(scene, **changes):
    return heightmap_from_rgbd(scene.color, scene.depth, scene.camera, scene.camera_in_base, WORKSPACE, 7)


def top_mask(box, margin: float) -> np.ndarray:
    """Cells at least `margin` [m] inside (or, negative, outside) a box's outline."""
    rows, cols = np.mgrid[0 : WORKSPACE.rows, 0 : WORKSPACE.cols]
    x = WORKSPACE.x_min + (cols + 0.5) * WORKSPACE.pixel_size
    y = WORKSPACE.y_min + (rows + 0.5) * WORKSPACE.pixel_size
    inside_x = (x > box.low[0] + margin) & (x < box.high[0] - margin)
    return inside_x & (y > box.low[1] + margin) & (y < box.high[1] - margin)


def test_a_bare_table_is_flat_and_has_no_pinholes(table_scene) -> None:
    heightmap = build(table_scene)
    assert heightmap.valid.all()
    assert np.abs(heightmap.height).max() < 1e-4
    assert np.all(heightmap.color == (120, 110, 100))
    assert heightmap.stamp_ns == 7


def test_a_noisy_table_has_no_pinholes(table_scene) -> None:
    noise = np.random.default_rng(1).normal(0.0, 0.0015, table_scene.depth.shape)
    heightmap = build(table_scene._replace(depth=(table_scene.depth + noise).astype(np.float32)))
    assert heightmap.valid_fraction > 0.999
    assert np.abs(heightmap.height[heightmap.valid]).mean() < 0.0015


def test_boxes_come_out_at_their_height_place_and_colour(box_scene, boxes) -> None:
    heightmap = build(box_scene)
    for box in boxes:
        top = top_mask(box, WORKSPACE.pixel_size)
        assert heightmap.valid[top].all()
        assert np.abs(heightmap.height[top] - box.high[2]).max() < 0.003
        assert np.all(heightmap.color[top] == box.color)
    far = ~np.any([top_mask(box, -0.1) for box in boxes], axis=0)
    assert np.abs(heightmap.height[far]).max() < 0.003


def test_what_a_box_hides_stays_unseen(box_scene, boxes) -> None:
    heightmap = build(box_scene)
    slab = boxes[1]
    behind_x = slab.low[0] - 0.02  # the camera looks from +x: its shadow falls on the -x side
    behind = [WORKSPACE.xy_to_pixel(behind_x, y) for y in np.linspace(slab.low[1] + 0.03, slab.high[1] - 0.03, 9)]
    assert not any(heightmap.valid[pixel] for pixel in behind)
    assert np.all(heightmap.height[~heightmap.valid] == 0.0)
    assert np.all(heightmap.color[~heightmap.valid] == 0)


def test_no_height_is_invented_between_table_and_box(box_scene, boxes) -> None:
    heightmap = build(box_scene)
    # Walls are seen from the camera's side only; elsewhere a cell shows the table or a top, nothing between.
    for box in boxes:
        shadow_side = top_mask(box, -0.08) & ~top_mask(box, -0.004)
        cols = np.arange(WORKSPACE.cols)[None, :]
        shadow_side &= cols < WORKSPACE.xy_to_pixel(box.low[0], box.low[1])[1] - 2
        heights = heightmap.height[shadow_side & heightmap.valid]
        assert np.all((heights < 0.003) | (heights > box.high[2] - 0.003))


def test_missing_depth_makes_holes_not_heights(table_scene) -> None:
    depth = table_scene.depth.copy()
    depth[200:240, 400:460] = np.nan
    depth[260:280, 500:520] = 0.0
    depth[260:280, 540:560] = np.inf
    heightmap = build(table_scene._replace(depth=depth))
    assert 0.8 < heightmap.valid_fraction < 1.0
    assert np.abs(heightmap.height).max() < 1e-4


@pytest.mark.parametrize("value", [np.nan, 0.0, np.inf, -1.0, 1e9])
def test_a_frame_without_depth_gives_an_empty_heightmap(table_scene, value: float) -> None:
    heightmap = build(table_scene._replace(depth=np.full_like(table_scene.depth, value)))
    assert heightmap.valid_fraction == 0.0


def test_a_camera_that_looks_away_gives_an_empty_heightmap(table_scene) -> None:
    away = Pose.looking_at((1.2, 0.0, 0.9), (2.4, 0.0, 0.9))
    heightmap = build(table_scene._replace(camera_in_base=away))
    assert heightmap.valid_fraction == 0.0


def test_it_is_deterministic(box_scene) -> None:
    noise = np.random.default_rng(1).normal(0.0, 0.002, box_scene.depth.shape).astype(np.float32)
    noisy = box_scene._replace(depth=box_scene.depth + noise)
    first, second = build(noisy), build(noisy)
    np.testing.assert_array_equal(first.height, second.height)
    np.testing.assert_array_equal(first.color, second.color)


@pytest.mark.parametrize(
    ("name", "coefficients"),
    [("plumb_bob", (0.09, -0.2, 0.0008, -0.0005, 0.08)),
     ("rational_polynomial", (0.52, -2.6, 0.0006, -0.0003, 1.5, 0.40, -2.4, 1.4))],
)  # fmt: skip
def test_a_distorted_camera_sees_the_same_heights(cast_scene, boxes, camera_in_base, name, coefficients) -> None:
    lens = CameraModel(960, 540, 540.0, 540.0, 480.0, 270.0, name, coefficients)
    heightmap = build(cast_scene(lens, camera_in_base))
    for box in boxes:
        assert np.abs(heightmap.height[top_mask(box, WORKSPACE.pixel_size)] - box.high[2]).max() < 0.003


@pytest.mark.parametrize("eye", [(0.45, 0.0, 1.4), (0.45, 1.1, 0.8), (1.5, -0.4, 0.7)])
def test_other_viewpoints_see_the_same_tops(cast_scene, boxes, camera, eye) -> None:
    heightmap = build(cast_scene(camera, Pose.looking_at(eye, (0.45, 0.0, 0.0))))
    for box in boxes:
        top = top_mask(box, 2 * WORKSPACE.pixel_size)
        assert heightmap.valid[top].mean() > 0.99
        assert np.abs(heightmap.height[top & heightmap.valid] - box.high[2]).max() < 0.003


def test_a_known_point_lands_in_its_cell(camera, camera_in_base) -> None:
    rng = np.random.default_rng(3)
    builder = HeightmapBuilder(camera, camera_in_base, WORKSPACE)
    for _ in range(10):
        row, col = rng.integers(120, 340), rng.integers(300, 660)
        depth = np.full((540, 960), np.nan, dtype=np.float32)
        point = camera_in_base.apply(camera.rays()[row, col] * 1.25)
        depth[row, col] = 1.25
        heightmap = builder.build(np.full((540, 960, 3), 9, dtype=np.uint8), depth)
        inside = WORKSPACE.contains_xy(point[0], point[1]) and -0.02 <= point[2] <= 0.28
        assert heightmap.valid.sum() == int(inside)
        if inside:
            pixel = WORKSPACE.xy_to_pixel(point[0], point[1])
            assert heightmap.valid[pixel]
            assert heightmap.height[pixel] == pytest.approx(point[2], abs=1e-4)


def test_images_of_another_size_are_refused(camera, camera_in_base) -> None:
    builder = HeightmapBuilder(camera, camera_in_base, WORKSPACE)
    depth, color = np.ones((540, 960), np.float32), np.zeros((540, 960, 3), np.uint8)
    with pytest.raises(ImageError, match="depth image is"):
        builder.build(color, depth[:480])
    with pytest.raises(ImageError, match="colour image is"):
        builder.build(color[:480], depth)


@pytest.mark.parametrize("higher_first", [True, False])
def test_the_highest_of_two_points_in_one_cell_wins(higher_first: bool) -> None:
    """Two pixels above each other look onto one cell; whichever the image has first, the higher one is shown."""
    camera = CameraModel(4, 4, 540.0, 540.0, 1.5, 1.5)
    straight_down = Pose.looking_at((0.4512, 0.0012, 0.9), (0.4512, 0.0012, 0.0))
    builder = HeightmapBuilder(camera, straight_down, WORKSPACE)
    depth, color = np.full((4, 4), np.nan, np.float32), np.zeros((4, 4, 3), np.uint8)
    high, low = ((1, 1), (2, 2)) if higher_first else ((2, 2), (1, 1))
    for pixel, height, value in ((high, 0.05, 200), (low, 0.01, 30)):
        depth[pixel], color[pixel] = 0.9 - height, value
    heightmap = builder.build(color, depth)
    assert heightmap.valid.sum() == 1
    assert heightmap.height[heightmap.valid] == pytest.approx(0.05, abs=1e-4)
    assert np.all(heightmap.color[heightmap.valid] == 200)


def test_the_colour_of_a_cell_is_that_of_the_nearest_pixel(table_scene) -> None:
    """Every pixel has a colour of its own: a cell's says which pixel it took, and that one looks onto the cell."""
    at_row, at_col = np.mgrid[0:540, 0:960]
    color = np.stack([at_row & 255, at_col & 255, (at_row >> 8) | (at_col >> 8 << 4)], axis=-1).astype(np.uint8)
    heightmap = build(table_scene._replace(color=color))
    low_row, low_col, high = np.moveaxis(heightmap.color.astype(int), -1, 0)
    taken = low_row + ((high & 15) << 8), low_col + (high >> 4 << 8)
    seen_at = table_scene.camera_in_base.apply(table_scene.camera.rays() * table_scene.depth[..., None])[..., :2]
    rows, cols = np.mgrid[0 : WORKSPACE.rows, 0 : WORKSPACE.cols]
    for axis, (low, cell) in enumerate(((WORKSPACE.x_min, cols), (WORKSPACE.y_min, rows))):
        centre = low + (cell + 0.5) * WORKSPACE.pixel_size
        # x runs along the image's rows here, y along its columns
        gap = np.abs(np.gradient(seen_at[..., axis], axis=axis))[taken]
        off = np.abs(seen_at[..., axis][taken] - centre)
        assert np.all(off <= 0.5 * WORKSPACE.pixel_size + 0.55 * gap + 2e-4)


def test_what_depends_on_the_camera_alone_is_computed_once(box_scene, monkeypatch: pytest.MonkeyPatch) -> None:
    """The rays belong to the camera at its pose: a further frame costs none of them again."""
    workspace = WorkspaceSpec(x_max=0.6)  # which no other test has built for
    rays, calls = CameraModel.rays, []
    monkeypatch.setattr(CameraModel, "rays", lambda camera: calls.append(camera) or rays(camera))
    for scene in (box_scene, box_scene, box_scene._replace(depth=box_scene.depth + np.float32(0.001))):
        heightmap_from_rgbd(scene.color, scene.depth, scene.camera, scene.camera_in_base, workspace)
    assert len(calls) == 1


def test_the_order_of_the_pixels_does_not_matter(box_scene) -> None:
    """The same camera on its head has every pixel elsewhere in the image, and the last ones first."""
    lens, pose = box_scene.camera, box_scene.camera_in_base
    noise = np.random.default_rng(2).normal(0.0, 0.0015, box_scene.depth.shape).astype(np.float32)
    depth = box_scene.depth + noise
    upright = heightmap_from_rgbd(box_scene.color, depth, lens, pose, WORKSPACE)
    turned = replace(lens, cx=lens.width - 1 - lens.cx, cy=lens.height - 1 - lens.cy)
    on_its_head = Pose(pose.rotation @ np.diag([-1.0, -1.0, 1.0]), pose.translation)
    other = heightmap_from_rgbd(
        np.ascontiguousarray(box_scene.color[::-1, ::-1]), depth[::-1, ::-1].copy(), turned, on_its_head, WORKSPACE
    )
    assert (upright.valid != other.valid).mean() < 1e-3
    both = upright.valid & other.valid
    assert np.abs(upright.height - other.height)[both].max() < 0.02  # samples between pixels lie elsewhere
    assert np.abs(upright.height - other.height)[both].mean() < 1e-4


class ShuffledCamera(NamedTuple):
    """A camera whose pixels look in the directions (H, W, 3) of another's, in any order."""

    directions: np.ndarray

    @property
    def height(self) -> int:
        return self.directions.shape[0]

    @property
    def width(self) -> int:
        return self.directions.shape[1]

    def rays(self) -> np.ndarray:
        return self.directions


@pytest.mark.parametrize("seed", range(6))
def test_any_order_of_the_points_gives_the_same_heightmap(cast_scene, camera_in_base, seed: int) -> None:
    """Points alone, for what lies between two pixels depends on which are neighbours."""
    rng, lens = np.random.default_rng(seed), CameraModel(480, 270, 270.0, 270.0, 240.0, 135.0)
    scene = cast_scene(lens, camera_in_base)
    depth = (scene.depth + rng.normal(0.0, 0.003, scene.depth.shape)).astype(np.float32)
    depth[rng.random(depth.shape) < 0.05] = np.nan
    color = rng.integers(0, 256, scene.color.shape, dtype=np.uint8)
    order = rng.permutation(depth.size)

    def made(order: np.ndarray) -> Heightmap:
        rays, colors, depths = (
            image.reshape(depth.size, -1)[order].reshape(image.shape) for image in (lens.rays(), color, depth)
        )
        shuffled: Any = ShuffledCamera(rays)
        return HeightmapBuilder(shuffled, camera_in_base, WORKSPACE, max_depth_step=-1.0).build(colors, depths)

    one, other = made(np.arange(depth.size)), made(order)
    assert 0.1 < one.valid_fraction < 1.0
    np.testing.assert_array_equal(one.valid, other.valid)
    np.testing.assert_array_equal(one.height, other.height)
    assert (one.color != other.color).any(axis=-1).mean() < 0.01, "of two equally high points either may show"


def splatted(color: np.ndarray, depth: np.ndarray, builder: HeightmapBuilder) -> tuple[np.ndarray, np.ndarray]:
    """Make heights [10 um] and colours the slow way: every sample of every pixel, in order of height, then of pixel."""
    spec = builder.workspace
    rays = builder.camera.rays() @ builder.camera_in_base.rotation.T.astype(np.float32)
    origin = builder.camera_in_base.translation - [spec.x_min, spec.y_min, spec.z_min]
    slope = np.moveaxis(rays, -1, 0) / np.array([spec.pixel_size, spec.pixel_size, 1e-5], np.float32)[:, None, None]
    grid = depth * slope + (origin / [spec.pixel_size, spec.pixel_size, 1e-5]).astype(np.float32)[:, None, None]
    down, right = (np.abs(np.diff(depth, axis=axis)) <= builder.max_depth_step for axis in (0, 1))
    patch = right[:-1] & right[1:] & down[:, :-1] & down[:, 1:]
    found = []
    for i, j in np.ndindex(*builder._splits):
        a, b = np.float32(i / builder._splits[0]), np.float32(j / builder._splits[1])
        across = grid[:, :, :-1] * (1 - b) + grid[:, :, 1:] * b if j else grid
        x, y, z = across[:, :-1] * (1 - a) + across[:, 1:] * a if i else across
        inside = (x >= 0) & (x < spec.cols) & (y >= 0) & (y < spec.rows) & (z >= 0)
        inside &= (patch if j else down) if i else right if j else True
        row, col = np.nonzero(inside & (z <= (spec.z_max - spec.z_min) / 1e-5))
        pixel = (row + (a >= 0.5)) * depth.shape[1] + col + (b >= 0.5)
        cell = y[row, col].astype(int) * spec.cols + x[row, col].astype(int)
        found.append(np.stack([(z[row, col] + np.float32(0.5)).astype(int), pixel, cell]))
    height, pixel, cell = np.concatenate(found, axis=1)
    order = np.lexsort((pixel, height))
    heights, picture = np.full(spec.rows * spec.cols, -1), np.zeros((spec.rows * spec.cols, 3), np.uint8)
    heights[cell[order]], picture[cell[order]] = height[order], color.reshape(-1, 3)[pixel[order]]
    return heights.reshape(spec.shape), picture.reshape(*spec.shape, 3)


def test_heights_and_colours_are_those_of_the_slow_way(box_scene) -> None:
    rng = np.random.default_rng(4)
    depth = (box_scene.depth + rng.normal(0.0, 0.0015, box_scene.depth.shape)).astype(np.float32)
    depth[rng.random(depth.shape) < 0.02] = np.nan
    color = rng.integers(0, 256, box_scene.color.shape, dtype=np.uint8)  # no pixel like its neighbours
    builder = HeightmapBuilder(box_scene.camera, box_scene.camera_in_base, WORKSPACE)
    assert min(builder._splits) > 1
    ours = builder.build(color, depth)
    heights, picture = splatted(color, depth, builder)
    assert (ours.valid == (heights >= 0)).all()
    differ = ours.valid & (np.abs(ours.height - (heights * 1e-5 + WORKSPACE.z_min)) > 1.5e-5)
    assert differ.mean() < 1e-3  # a last bit may turn a height's step
    assert (ours.color != picture).any(axis=-1).mean() < 1e-3
