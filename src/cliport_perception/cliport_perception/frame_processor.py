"""The processing of one camera's frames into heightmaps and clouds, each at its own rate."""

from __future__ import annotations

from array import array
from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from cliport_core.heightmap import Heightmap
from cliport_core.pose import Pose
from cliport_core.workspace import WorkspaceSpec
from cliport_perception.camera_health import CameraHealth
from cliport_perception.camera_model import CameraModel
from cliport_perception.clouds import MARGIN, CloudBuilder, CloudRegion
from cliport_perception.depth_correction import AS_MEASURED, DepthCorrection
from cliport_perception.depth_noise import DepthNoise
from cliport_perception.depth_unit import DepthUnit
from cliport_perception.errors import UnfitFrameError
from cliport_perception.heightmap_builder import HeightmapBuilder
from cliport_perception.surroundings_watch import SurroundingsWatch
from cliport_perception.table_watch import TableLimits, TableWatch
from cliport_perception.temporal_filter import TemporalFilter


class FrameProducts(NamedTuple):
    """The heightmap of a frame, and its cloud: the buffer of `CloudBuilder`, or None when none is due.

    cloud_stamp_ns: when what the cloud shows was seen [ns].
    """

    heightmap: Heightmap
    cloud: array[int] | None
    cloud_stamp_ns: int = 0


class FrameProcessor:
    """Keeps the rays of the current camera and pose, and the rates: heightmap_hz and points_hz at most.

    A frame's cloud is made in a thread of its own while its heightmap is made.

    points_margin: how far beyond the workspace the cloud reaches [m]. table: how far the table may seem to move, which
    means that the camera did; None: it is not watched. depth_frames: over which depth is averaged. max_picture_motion:
    how far what lies around the workspace may, as a share of the picture's width; 0: it is not watched.
    """

    def __init__(
        self,
        workspace: WorkspaceSpec,
        health: CameraHealth,
        heightmap_hz: float,
        points_hz: float,
        points_margin: float = MARGIN,
        table: TableLimits | None = None,
        depth_frames: int = 1,
        max_picture_motion: float = 0.0,
    ) -> None:
        self._workspace = workspace
        self._region = CloudRegion.around(workspace, points_margin)
        self._health = health
        self._heightmap_rate = _Rate(heightmap_hz)
        self._points_rate = _Rate(points_hz)
        self._table_limits = table
        self._filter = TemporalFilter(depth_frames)
        self._max_picture_motion = max_picture_motion
        self._table: TableWatch | None = None
        self._surroundings: SurroundingsWatch | None = None
        self._builders: tuple[HeightmapBuilder, CloudBuilder] | None = None
        self._correction = AS_MEASURED
        self._beside = ThreadPoolExecutor(1, "cloud")  # NumPy and OpenCV let the other thread run meanwhile

    def admits(self, stamp_ns: int, now_ns: int) -> bool:
        """Return True if a heightmap is due for a frame.

        Raises:
            UnfitFrameError: when the frame is too old, or from the future.
        """
        _refuse(self._health.check_age(stamp_ns, now_ns))
        return self._heightmap_rate.is_due(stamp_ns)

    def process(
        self,
        color: npt.NDArray[np.uint8],
        depth_m: npt.NDArray[np.float32],
        camera: CameraModel,
        camera_in_base: Pose,
        stamp_ns: int,
        correction: DepthCorrection = AS_MEASURED,
    ) -> FrameProducts:
        """Make the products of color (H, W, 3) RGB and depth_m (H, W) [m], NaN where unknown.

        correction: of depth, before anything is made of it; another one than before begins anew, as another pose does.

        Raises:
            ImageError: when an image does not have the camera's size.
            UnfitFrameError: when too little of the workspace is seen, or the camera was moved.
        """
        to_heightmap, to_cloud = self._builders_for(camera, camera_in_base, correction)
        depth_m = self._filter.add(correction.apply(depth_m))
        # the cloud of a frame that is refused below is made in vain
        coming = self._beside.submit(to_cloud.build, color, depth_m) if self._points_rate.is_due(stamp_ns) else None
        heightmap = to_heightmap.build(color, depth_m, stamp_ns)
        if self._table is not None:
            fault = self._table.check(depth_m)
            self._adapt(self._table.noise, to_heightmap)
            _refuse(fault or self._health.check_noise(self._table.noise.sigma))
        if self._surroundings is not None:
            _refuse(self._surroundings.check(color, stamp_ns))
        unseen = self._health.check_valid_fraction(heightmap.valid_fraction)
        _refuse(unseen and (DepthUnit(camera, camera_in_base, self._workspace).fault(depth_m) or unseen))
        cloud = None
        if coming is not None:
            cloud = coming.result()
            self._points_rate.note(stamp_ns)
        self._heightmap_rate.note(stamp_ns)
        self._health.on_served()
        return FrameProducts(heightmap, cloud, stamp_ns)

    def _adapt(self, noise: DepthNoise, to_heightmap: HeightmapBuilder) -> None:
        """Let the frames to come be judged by the noise that was measured up to now."""
        to_heightmap.adapt(noise)
        self._filter.adapt(noise)

    def _builders_for(
        self, camera: CameraModel, pose: Pose, correction: DepthCorrection
    ) -> tuple[HeightmapBuilder, CloudBuilder]:
        current = self._builders
        same = correction.is_close(self._correction)
        if same and current and current[1].camera == camera and current[1].camera_in_base.is_close(pose):
            return current
        self._correction = correction
        self._builders = (
            HeightmapBuilder(camera, pose, self._workspace),
            CloudBuilder(camera, pose, self._region),
        )
        self._filter.clear()
        if self._table_limits is not None:
            self._table = TableWatch(camera, pose, self._workspace, self._table_limits)
        if self._max_picture_motion > 0.0:
            self._surroundings = SurroundingsWatch(camera, pose, self._workspace, self._max_picture_motion)
        return self._builders


class _Rate:
    """At most `hz` a second by the frames' own stamps; 0 means every frame."""

    def __init__(self, hz: float) -> None:
        self._period_ns = int(0.95e9 / hz) if hz > 0.0 else 0  # some slack: camera rates are never exact
        self._last_ns: int | None = None

    def is_due(self, stamp_ns: int) -> bool:
        return self._last_ns is None or not 0 <= stamp_ns - self._last_ns < self._period_ns

    def note(self, stamp_ns: int) -> None:
        self._last_ns = stamp_ns


def _refuse(reason: str | None) -> None:
    if reason is not None:
        raise UnfitFrameError(reason)
