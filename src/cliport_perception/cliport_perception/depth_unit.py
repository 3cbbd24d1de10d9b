"""A guess at the unit of depth that shows nothing of the workspace: how many times what a calibrated camera sees."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from cliport_core.pose import Pose
from cliport_core.workspace import WorkspaceSpec
from cliport_perception.camera_model import CameraModel

# Tenths and quarters of millimetres taken for whole ones, and metres for millimetres. Millimetres taken for metres are
# refused when they are read; a tenth and the like may be a hand before the camera.
_FACTORS = (10.0, 4.0, 0.001)
_TOLERANCE = 0.2  # of a factor
_ALIKE, _LEAST_SHARE = 0.05, 0.5  # so alike are so many pixels where it is the table in another unit
_EVERY = 8  # pixel of a row and of a column that is looked at


class DepthUnit:
    """Depth images of one camera at one pose, against the depth of the empty workspace's floor."""

    def __init__(self, camera: CameraModel, camera_in_base: Pose, workspace: WorkspaceSpec) -> None:
        rays = camera.rays()[::_EVERY, ::_EVERY].astype(np.float64) @ camera_in_base.rotation.T
        with np.errstate(divide="ignore", invalid="ignore"):
            floor = (workspace.z_min - camera_in_base.translation[2]) / rays[..., 2]
            looks = workspace.contains(rays * floor[..., None] + camera_in_base.translation) & (floor > 0.0)
        self._floor = np.where(looks, floor, np.nan)

    def fault(self, depth_m: npt.NDArray[np.float32]) -> str | None:
        """Return what is wrong with the unit of a depth image (H, W) that was taken for metres; None: nothing is."""
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = depth_m[::_EVERY, ::_EVERY] / self._floor
        ratio = ratio[np.isfinite(ratio) & (ratio > 0.0)]
        if not ratio.size:
            return None
        middle = float(np.median(ratio))
        is_table = np.mean(np.abs(ratio / middle - 1.0) < _ALIKE) > _LEAST_SHARE
        for factor in _FACTORS:
            if is_table and abs(middle / factor - 1.0) < _TOLERANCE:
                return (
                    f"depth is about {factor:g} times what this camera, as calibrated, sees of the table: is it in "
                    "another unit? 32FC1 must hold metres, 16UC1 millimetres"
                )
        return None
