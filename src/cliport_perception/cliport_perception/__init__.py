"""CLIPort's perception: camera model, clouds and the top-down heightmap."""

from cliport_perception.camera_model import CameraModel
from cliport_perception.errors import (
    CameraModelError,
    EncodingError,
    FrameError,
    ImageError,
    PerceptionError,
    PixelOutsideError,
    UnfitFrameError,
    WorkspaceError,
)
from cliport_perception.heightmap import Heightmap
from cliport_perception.heightmap_builder import HeightmapBuilder, heightmap_from_rgbd
from cliport_perception.pose import PlanarPose, Pose
from cliport_perception.primitive import Primitive
from cliport_perception.workspace import WorkspaceSpec

__all__ = [
    "CameraModel",
    "CameraModelError",
    "EncodingError",
    "FrameError",
    "Heightmap",
    "HeightmapBuilder",
    "ImageError",
    "PerceptionError",
    "PixelOutsideError",
    "PlanarPose",
    "Pose",
    "Primitive",
    "UnfitFrameError",
    "WorkspaceError",
    "WorkspaceSpec",
    "heightmap_from_rgbd",
]
