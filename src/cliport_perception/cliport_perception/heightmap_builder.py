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
from cliport_perception.line_of_sight import bounds, depths_of_samples, region_of_interest, widest_gaps
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
        self._roi = region_of_interest(rays, camera_in_base, workspace)
        roi_rays = np.ascontiguousarray(np.moveaxis(rays[self._roi], -1, 0))  # (3, h, w)
        self._gaps = widest_gaps(roi_rays, camera_in_base, workspace)
        self._splits = self._splits_with(_JITTER)
        self._enter, self._leave = depths_of_samples(roi_rays, camera_in_base, workspace)
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
        depth_roi, color_roi = depth_m[self._roi], color[self._roi]
        # What is not known is NaN or infinite, or lies at or behind the camera: all outside the workspace.
        with np.errstate(invalid="ignore"):
            window = self._window(depth_roi)
            depth = np.ascontiguousarray(depth_roi[window], dtype=np.float32)
            nothing = (-1 << _INDEX_BITS) | depth.size  # below any sample's key; its pixel comes after the last
            keys: npt.NDArray[np.int64] = np.full(rows * cols, nothing, dtype=np.int64)
            if depth.size:
                self._splat(depth, self._slope[:, window[0], window[1]], keys)
        seen = keys >= 0
        height = ((keys >> _INDEX_BITS) * _HEIGHT_STEP + self.workspace.z_min).astype(np.float32)
        height[~seen] = 0.0
        pixels = np.zeros((depth.size + 1, 3), dtype=np.uint8)  # the last one is black
        pixels[:-1].reshape(*depth.shape, 3)[...] = color_roi[window]
        flat_color = pixels.take(keys & ((1 << _INDEX_BITS) - 1), axis=0, mode="clip")  # in range; "raise" is slower
        return Heightmap(
            flat_color.reshape(rows, cols, 3),
            height.reshape(rows, cols),
            seen.reshape(rows, cols),
            self.workspace,
            stamp_ns,
        )

    def _window(self, depth: FloatImage) -> tuple[slice, slice]:
        """Return the rows and columns of depth (h, w) [m], seen in the region, that have samples inside the workspace.

        The region is where the workspace can be seen; much of what this frame shows there lies beside or behind it.
        """
        # Each of the pixels that a sample lies between is within two steps of its depth: one down, one to the right.
        slack = np.float32(max(0.0, 2.0 * self.max_depth_step))
        return bounds((depth + slack >= self._enter) & (depth - slack <= self._leave))

    def _splat(self, depth: FloatImage, slope: FloatImage, keys: npt.NDArray[np.int64]) -> None:
        """Raise keys (rows * cols,) to `height << 32 | pixel` of the highest sample in each cell.

        depth: (h, w) [m]; slope: (3, h, w), of the grid coordinates over depth [1/m].
        """
        grid = np.multiply(depth, slope, out=self._scratch.array("grid", slope.shape, np.float32))
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
        cell = row.ravel().take(index).astype(np.int32)
        cell *= cols
        cell += column.ravel().take(index).astype(np.int32)
        key = (height.ravel().take(index) + np.float32(0.5)).astype(np.int32).astype(np.int64)  # faster than at once
        key <<= _INDEX_BITS
        key |= np.add(index, nearest, out=index)
        np.maximum.at(keys, cell.astype(np.intp), key)

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
    w, flat = depth.shape[1], depth.ravel()  # all rows in one go: the right neighbour of a row's end is masked
    down, right, patch = (np.zeros(depth.shape, dtype=bool) for _ in range(3))
    np.less_equal(np.abs(flat[:-w] - flat[w:]), max_step, out=down.ravel()[:-w])  # False where NaN
    np.less_equal(np.abs(flat[:-1] - flat[1:]), max_step, out=right.ravel()[:-1])
    right[:, -1] = False
    beside = down.ravel()[1 : flat.size - w + 1].reshape(-1, w)
    patch[:-1] = right[:-1] & right[1:] & down[:-1] & beside
    return down, right, patch


def _blend(planes: FloatImage, share: float, axis: int, blended: FloatImage) -> FloatImage:
    """Return, in `blended`, planes (3, h, w) `share` of the way to the next pixel along `axis`; not at its end."""
    step = planes.shape[2] if axis == 1 else 1
    flat = planes.ravel()  # all rows in one go
    first, second, inner = flat[:-step], flat[step:], blended.ravel()[:-step]
    if share == 0.5:
        np.add(first, second, out=inner)  # halves are exact: the same numbers in fewer steps
        inner *= np.float32(0.5)
    else:
        np.multiply(first, np.float32(1.0 - share), out=inner)
        inner += second * np.float32(share)
    return blended
