"""The fast way from depth and colour images to a heightmap: rays are computed once per camera pose."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from cliport_core.errors import ImageError
from cliport_core.heightmap import Heightmap
from cliport_core.pose import Pose
from cliport_core.workspace import WorkspaceSpec
from cliport_perception.camera_model import CameraModel
from cliport_perception.depth_noise import DepthNoise
from cliport_perception.scratch import Scratch

FloatImage: TypeAlias = npt.NDArray[np.float32]

MAX_DEPTH_STEP = 0.012  # neighbouring pixels whose depth differs by less lie on one surface [m]
_MAX_SPLITS = 4  # at most this many samples from a pixel to its neighbour
_JITTER = 0.0015  # how far depth noise may push neighbouring samples apart on the table [m]
_HEIGHT_STEP = 1e-5  # resolution of the heights that come out [m]
_INDEX_BITS = 32  # low bits of a sort key that hold the image pixel


class HeightmapBuilder:
    """Projects the frames of one camera at one pose onto one workspace.

    The highest point of a cell wins. A pixel covers the patch up to its right and lower neighbours: where
    those lie on the same surface (depth step below `max_depth_step` [m]), the patch is sampled densely enough
    that a seen surface has no pinholes; across depth edges nothing is invented. Unseen cells stay invalid.

    camera_in_base: pose of the optical frame (z forward, x right, y down) in the base frame.
    """

    def __init__(
        self,
        camera: CameraModel,
        camera_in_base: Pose,
        workspace: WorkspaceSpec,
        max_depth_step: float = MAX_DEPTH_STEP,
    ) -> None:
        self.camera = camera
        self.camera_in_base = camera_in_base
        self.workspace = workspace
        self.max_depth_step = self._quiet_step = float(max_depth_step)
        rays = camera.rays() @ camera_in_base.rotation.T.astype(np.float32)  # (H, W, 3), base frame
        self._roi = _region_of_interest(rays, camera_in_base, workspace)
        roi_rays = np.ascontiguousarray(np.moveaxis(rays[self._roi], -1, 0))  # (3, h, w)
        self._gaps = _widest_gaps(roi_rays, camera_in_base, workspace)
        self._splits = self._splits_with(_JITTER)
        numbers = np.arange(camera.height * camera.width, dtype=np.int64).reshape(camera.height, camera.width)
        self._pixels = np.ascontiguousarray(numbers[self._roi]).ravel()  # of the region, by number in the whole image
        # grid coordinates are (cell column, cell row, height step): one multiply and one add per pixel
        scale = np.array([workspace.pixel_size, workspace.pixel_size, _HEIGHT_STEP])
        origin = np.array([workspace.x_min, workspace.y_min, workspace.z_min])
        self._slope = roi_rays / scale.astype(np.float32)[:, None, None]
        self._offset = ((camera_in_base.translation - origin) / scale).astype(np.float32)
        self._scratch = Scratch()
        self._height_steps = (workspace.z_max - workspace.z_min) / _HEIGHT_STEP

    def adapt(self, noise: DepthNoise) -> None:
        """Let the steps between neighbours on one surface be as large as the noise of depth makes them."""
        self.max_depth_step = self._quiet_step * noise.growth
        self._splits = self._splits_with(_JITTER * noise.growth)

    def build(self, color: npt.NDArray[np.uint8], depth_m: FloatImage, stamp_ns: int = 0) -> Heightmap:
        """Make a heightmap from color (H, W, 3) RGB and depth_m (H, W) [m], not finite or <= 0 where unknown.

        Raises:
            ImageError: when an image does not have the camera's size.
        """
        self._check_sizes(color, depth_m)
        rows, cols = self.workspace.shape
        keys: npt.NDArray[np.int64] = np.full(rows * cols, -1, dtype=np.int64)
        depth = np.ascontiguousarray(depth_m[self._roi], dtype=np.float32)
        if depth.size:
            # What is not known is NaN or infinite, or lies at or behind the camera: all outside the workspace.
            with np.errstate(invalid="ignore"):
                self._splat(depth, keys)
        seen = keys >= 0
        unseen = np.flatnonzero(~seen)
        keys[unseen] = 0
        height = ((keys >> _INDEX_BITS) * _HEIGHT_STEP + self.workspace.z_min).astype(np.float32)
        pixels = self._pixels.take(keys & ((1 << _INDEX_BITS) - 1)) if self._pixels.size else keys
        flat_color = color.reshape(-1, 3).take(pixels, axis=0)  # of all cells: rows are read fast, and written slowly
        height[unseen], flat_color[unseen] = 0.0, 0
        return Heightmap(
            flat_color.reshape(rows, cols, 3),
            height.reshape(rows, cols),
            seen.reshape(rows, cols),
            self.workspace,
            stamp_ns,
        )

    def _splat(self, depth: FloatImage, keys: npt.NDArray[np.int64]) -> None:
        """Raise keys (rows * cols,) to `height << 32 | pixel` of the highest sample in each cell."""
        grid = np.multiply(depth, self._slope, out=self._scratch.array("grid", self._slope.shape, np.float32))
        grid += self._offset[:, None, None]  # (3, h, w)
        down, right, patch = _same_surfaces(depth, self.max_depth_step)
        n_down, n_right = self._splits
        for j in range(n_right):
            b = j / n_right
            beside = self._blend(grid, b, 2, "beside") if j else grid
            for i in range(n_down):
                a = i / n_down
                samples = self._blend(beside, a, 1, "samples") if i else beside
                joined = (None if j == 0 else right) if i == 0 else down if j == 0 else patch
                nearest = int(a >= 0.5) * depth.shape[1] + int(b >= 0.5)
                self._raise_cells(samples, joined, nearest, keys)

    def _raise_cells(
        self, samples: FloatImage, joined: npt.NDArray[np.bool_] | None, nearest: int, keys: npt.NDArray[np.int64]
    ) -> None:
        """Raise keys to those of samples (3, h, w); nearest: how much higher the number of their colour's pixel is."""
        rows, cols = self.workspace.shape
        column, row, height = samples
        with np.errstate(invalid="ignore"):
            inside = (column >= 0) & (column < cols) & (row >= 0) & (row < rows)
            inside &= (height >= 0) & (height <= self._height_steps)
        if joined is not None:
            inside &= joined
        index = np.flatnonzero(inside)  # picked by number: a mask would be read anew for every plane
        cell = row.ravel().take(index).astype(np.int32) * cols + column.ravel().take(index).astype(np.int32)
        key = ((height.ravel().take(index) + 0.5).astype(np.int64) << _INDEX_BITS) | (index + nearest)
        np.maximum.at(keys, cell, key)

    def _blend(self, planes: FloatImage, share: float, axis: int, name: str) -> FloatImage:
        return _blend(planes, share, axis, self._scratch.array(name, planes.shape, np.float32))

    def _splits_with(self, jitter: float) -> tuple[int, int]:
        """Return the samples (down, right) that a pixel needs for one in every cell of the workspace's floor."""
        cell = self.workspace.pixel_size
        down, right = (min(_MAX_SPLITS, max(1, math.ceil((gap + jitter) / cell))) for gap in self._gaps)
        return down, right

    def _check_sizes(self, color: npt.NDArray[np.uint8], depth_m: FloatImage) -> None:
        size = (self.camera.height, self.camera.width)
        if depth_m.shape != size:
            raise ImageError(f"depth image is {depth_m.shape}, the camera model says {size} (rows, columns)")
        if color.shape != (*size, 3):
            raise ImageError(f"colour image is {color.shape}, the camera model says {(*size, 3)}")


@lru_cache(maxsize=4)
def _cached_builder(
    camera: CameraModel, rotation: bytes, translation: bytes, workspace: WorkspaceSpec
) -> HeightmapBuilder:
    pose = Pose(np.frombuffer(rotation).reshape(3, 3), np.frombuffer(translation))
    return HeightmapBuilder(camera, pose, workspace)


def heightmap_from_rgbd(
    color: npt.NDArray[np.uint8],
    depth_m: FloatImage,
    camera: CameraModel,
    camera_in_base: Pose,
    workspace: WorkspaceSpec,
    stamp_ns: int = 0,
) -> Heightmap:
    """Make one frame's heightmap; builders are cached, so repeated calls with the same camera are fast.

    color: (H, W, 3) uint8 RGB; depth_m: (H, W) float32 [m] along the optical axis, not finite or <= 0 where
    unknown; camera_in_base: pose of the optical frame in the base frame.

    Raises:
        ImageError: when an image does not have the camera's size.
    """
    builder = _cached_builder(
        camera, camera_in_base.rotation.tobytes(), camera_in_base.translation.tobytes(), workspace
    )
    return builder.build(color, depth_m, stamp_ns)


def _same_surfaces(depth: FloatImage, max_step: float) -> tuple[npt.NDArray[np.bool_], ...]:
    """Return masks (h, w) of pixels on one surface with the lower neighbour, with the right one, and with all three.

    Depth is known there and steps by `max_step` [m] at most. False in the last row or column, for want of a neighbour.
    """
    down, right, patch = (np.zeros(depth.shape, dtype=bool) for _ in range(3))
    np.less_equal(np.abs(depth[:-1] - depth[1:]), max_step, out=down[:-1])  # False where NaN
    np.less_equal(np.abs(depth[:, :-1] - depth[:, 1:]), max_step, out=right[:, :-1])
    top, bottom, left, beside = right[:-1, :-1], right[1:, :-1], down[:-1, :-1], down[:-1, 1:]
    patch[:-1, :-1] = top & bottom & left & beside
    return down, right, patch


def _blend(planes: FloatImage, share: float, axis: int, blended: FloatImage) -> FloatImage:
    """Return, in `blended`, planes (3, h, w) `share` of the way to the next pixel along `axis`; NaN at its end."""
    if axis == 1:
        first, second, inner, end = planes[:, :-1], planes[:, 1:], blended[:, :-1], blended[:, -1]
    else:
        first, second, inner, end = planes[:, :, :-1], planes[:, :, 1:], blended[:, :, :-1], blended[:, :, -1]
    end[...] = np.nan
    if share == 0.5:
        np.add(first, second, out=inner)  # halves are exact: the same numbers in fewer steps
        inner *= np.float32(0.5)
    else:
        np.multiply(first, np.float32(1.0 - share), out=inner)
        inner += second * np.float32(share)
    return blended


def _region_of_interest(
    rays: npt.NDArray[np.float32], camera_in_base: Pose, workspace: WorkspaceSpec
) -> tuple[slice, slice]:
    """Return the image rows and columns whose rays (H, W, 3) meet the workspace's volume (slab test)."""
    low = np.array([workspace.x_min, workspace.y_min, workspace.z_min]) - camera_in_base.translation
    high = np.array([workspace.x_max, workspace.y_max, workspace.z_max]) - camera_in_base.translation
    with np.errstate(divide="ignore", invalid="ignore"):
        to_low = low.astype(np.float32) / rays
        to_high = high.astype(np.float32) / rays
    enter = np.fmin(to_low, to_high).max(axis=-1)
    leave = np.fmax(to_low, to_high).min(axis=-1)
    meets = (leave >= np.fmax(enter, 0.0)) & np.isfinite(leave)
    if not meets.any():
        return slice(0, 0), slice(0, 0)
    at_rows = np.flatnonzero(meets.any(axis=1))
    at_cols = np.flatnonzero(meets.any(axis=0))
    h, w = meets.shape
    return (
        slice(max(0, int(at_rows[0]) - 1), min(h, int(at_rows[-1]) + 2)),
        slice(max(0, int(at_cols[0]) - 1), min(w, int(at_cols[-1]) + 2)),
    )


def _widest_gaps(rays: npt.NDArray[np.float32], camera_in_base: Pose, workspace: WorkspaceSpec) -> list[float]:
    """Return how far apart neighbouring pixels (down, right) see the workspace's floor at most [m]."""
    drop = workspace.z_min - camera_in_base.translation[2]
    with np.errstate(divide="ignore", invalid="ignore"):
        xy = rays[:2] * (drop / rays[2])  # (2, h, w): where the rays meet the floor
    x, y = xy[0] + camera_in_base.translation[0], xy[1] + camera_in_base.translation[1]
    inside = (x > workspace.x_min) & (x < workspace.x_max) & (y > workspace.y_min) & (y < workspace.y_max)
    widest = []
    for axis in (1, 2):
        gap = np.abs(np.diff(xy, axis=axis)).max(axis=0)
        near = np.take(inside, range(gap.shape[axis - 1]), axis=axis - 1)
        widest.append(float(gap[near].max()) if near.any() else workspace.pixel_size)
    return widest
