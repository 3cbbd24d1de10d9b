"""Several cameras' views joined into one, as the paper's simulator joins three: the highest point, the mean colour."""

from __future__ import annotations

from array import array
from collections.abc import Sequence

import numpy as np

from cliport_core.heightmap import Heightmap
from cliport_perception.camera_health import valid_fraction_fault
from cliport_perception.errors import UnfitFrameError
from cliport_perception.frame_processor import FrameProducts


class CameraFusion:
    """Keeps the newest view of each camera; the first camera's frames set the pace.

    Args:
        count: of the cameras.
        max_apart_s: by which another camera's view may be older than the first one's [s].
        min_valid_fraction: share of the workspace that all together must see.
    """

    def __init__(self, count: int, max_apart_s: float, min_valid_fraction: float = 0.0) -> None:
        self._count, self._max_apart_s, self._min_valid_fraction = count, max_apart_s, min_valid_fraction
        self._heightmaps: dict[int, Heightmap] = {}
        self._clouds: dict[int, tuple[array[int], int]] = {}

    def put(self, number: int, products: FrameProducts) -> FrameProducts | None:
        """Take note of what one camera, from 1, sees; return what all see, None at a frame of another than the first.

        Stamps are those of the oldest view.

        Raises:
            UnfitFrameError: at the first one's frame, while another camera gives no fresh view: what it alone sees
                would be missing; or when all together see too little.
        """
        self._heightmaps[number] = products.heightmap
        if products.cloud is not None:
            self._clouds[number] = products.cloud, products.cloud_stamp_ns
        if number != 1:
            return None
        if self._count == 1:
            return products
        stamp_ns = products.heightmap.stamp_ns
        for other in range(2, self._count + 1):
            self._check(other, stamp_ns)
        heightmap = fused([self._heightmaps[other] for other in range(1, self._count + 1)])
        if fault := valid_fraction_fault(heightmap.valid_fraction, self._min_valid_fraction):
            raise UnfitFrameError(fault)
        if products.cloud is None or len(self._clouds) < self._count:
            return FrameProducts(heightmap, None)
        clouds = [self._clouds[other] for other in range(1, self._count + 1)]
        joined = array("B")
        for cloud, _ in clouds:
            joined.extend(cloud)
        return FrameProducts(heightmap, joined, min(stamp for _, stamp in clouds))

    def _check(self, other: int, stamp_ns: int) -> None:
        seen = self._heightmaps.get(other)
        if seen is None:
            raise UnfitFrameError(f"camera {other} has given nothing usable yet: is it running, calibrated, remapped?")
        apart_s = (stamp_ns - seen.stamp_ns) * 1e-9
        if abs(apart_s) > self._max_apart_s:
            older = "older" if apart_s > 0.0 else "newer"
            raise UnfitFrameError(
                f"camera {other}'s newest view is {abs(apart_s):.1f} s {older} than camera 1's (at most "
                f"{self._max_apart_s:g} s): is it running, have both one clock?"
            )


def fused(views: Sequence[Heightmap]) -> Heightmap:
    """Return one heightmap of views of the same workspace: the greatest height, the mean of the colours that were seen.

    Its stamp is the oldest one's.
    """
    valid = np.stack([view.valid for view in views])
    heights = np.where(valid, np.stack([view.height for view in views]), -np.inf).max(axis=0)
    seen = np.asarray(valid.any(axis=0))
    colors = np.stack([view.color for view in views]).sum(axis=0, dtype=np.uint32, where=valid[..., None])
    mean = np.rint(colors / valid.sum(axis=0).clip(1)[..., None])
    return Heightmap(
        mean.astype(np.uint8),
        np.where(seen, heights, 0.0).astype(np.float32),
        seen,
        views[0].workspace,
        min(view.stamp_ns for view in views),
    )
