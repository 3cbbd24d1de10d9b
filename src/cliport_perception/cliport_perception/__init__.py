"""CLIPort's perception: camera model, clouds and the top-down heightmap."""

from cliport_perception.camera_model import CameraModel
from cliport_perception.errors import CameraModelError, PerceptionError, UnfitFrameError
from cliport_perception.heightmap_builder import HeightmapBuilder, heightmap_from_rgbd

__all__ = [
    "CameraModel",
    "CameraModelError",
    "HeightmapBuilder",
    "PerceptionError",
    "UnfitFrameError",
    "heightmap_from_rgbd",
]
