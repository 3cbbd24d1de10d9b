"""Images and camera of a large sensor, smaller by a whole factor: means of blocks, but never across an edge."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import numpy.typing as npt

from cliport_perception.camera_model import CameraModel
from cliport_perception.errors import CameraModelError
from cliport_perception.heightmap_builder import MAX_DEPTH_STEP


def decimated_camera(camera: CameraModel, factor: int) -> CameraModel:
    """Return the camera whose pixels are blocks of `factor` x `factor` of this one's; what is left at the end is cut.

    Raises:
        CameraModelError: when a block is larger than the image.
    """
    if factor > min(camera.width, camera.height):
        raise CameraModelError(f"images of {camera.width}x{camera.height} pixels cannot be decimated by {factor}")
    middle = (factor - 1) / 2.0  # of the first block, in pixels
    return replace(
        camera,
        width=camera.width // factor,
        height=camera.height // factor,
        fx=camera.fx / factor,
        fy=camera.fy / factor,
        cx=(camera.cx - middle) / factor,
        cy=(camera.cy - middle) / factor,
    )


def decimated_color(color: npt.NDArray[np.uint8], factor: int) -> npt.NDArray[np.uint8]:
    """Return the mean colours (H / factor, W / factor, 3) of the blocks of an image (H, W, 3)."""
    height, width = color.shape[0] // factor, color.shape[1] // factor
    whole = np.ascontiguousarray(color[: height * factor, : width * factor])
    return np.asarray(cv2.resize(whole, (width, height), interpolation=cv2.INTER_AREA), dtype=np.uint8)


def decimated_depth(depth_m: npt.NDArray[np.float32], factor: int) -> npt.NDArray[np.float32]:
    """Return depth [m] of the blocks of an image (H, W) [m], NaN where unknown.

    It is the mean of what lies on the surface of the block's middle depth, or of the nearer surface where two halves
    differ. A block that is unknown in more than half of its pixels stays unknown.
    """
    height, width = depth_m.shape[0] // factor, depth_m.shape[1] // factor
    whole = depth_m[: height * factor, : width * factor].reshape(height, factor, width, factor)
    blocks = np.moveaxis(whole, 2, 1).reshape(height, width, factor * factor)
    ordered = np.where(np.isfinite(blocks), blocks, np.inf)
    at = (factor * factor - 1) // 2
    middle = np.partition(ordered, at, axis=-1)[..., at]
    with np.errstate(invalid="ignore"):
        same = np.abs(ordered - middle[..., None]) < MAX_DEPTH_STEP  # False for a middle that is unknown
    total = np.where(same, blocks, 0.0).sum(axis=-1)
    count = same.sum(axis=-1)
    result: npt.NDArray[np.float32] = np.full((height, width), np.nan, dtype=np.float32)
    np.divide(total, count, out=result, where=count > 0, casting="unsafe")
    return result
