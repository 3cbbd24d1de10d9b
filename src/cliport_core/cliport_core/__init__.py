"""The base of every package: poses, workspace, heightmap, actions and outcomes, names, messages, ROS helpers."""

from cliport_core.action import ActionGoal, PickPlaceAction, Primitive
from cliport_core.errors import (
    CoreError,
    EncodingError,
    FrameError,
    GoalError,
    ImageError,
    PixelOutsideError,
    WorkspaceError,
)
from cliport_core.heightmap import Heightmap
from cliport_core.outcome import ActionResult, Outcome
from cliport_core.pose import PlanarPose, Pose
from cliport_core.workspace import WorkspaceSpec

__all__ = [
    "ActionGoal",
    "ActionResult",
    "CoreError",
    "EncodingError",
    "FrameError",
    "GoalError",
    "Heightmap",
    "ImageError",
    "Outcome",
    "PickPlaceAction",
    "PixelOutsideError",
    "PlanarPose",
    "Pose",
    "Primitive",
    "WorkspaceError",
    "WorkspaceSpec",
]
