"""Observation of the scene: images, camera and joints at one moment of an episode."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from cliport_core import topics
from cliport_core.errors import CoreError, FrameError, ImageError
from cliport_core.heightmap import Heightmap
from cliport_core.images import ImageBuffer, decode_color, decode_depth
from cliport_core.pose import Pose
from cliport_core.transforms import TransformTree
from cliport_core.workspace import WorkspaceSpec
from cliport_episodes.capture_setup import CaptureSetup
from cliport_episodes.errors import ObservationError
from cliport_episodes.message_types import decode, stamp_of
from cliport_episodes.raw import RawMessage
from cliport_perception.camera_model import CameraModel
from cliport_perception.heightmap_builder import heightmap_from_rgbd

TRANSFORM_TOPICS = (topics.TF_STATIC, topics.TF)
OBSERVATION_TOPICS = (topics.COLOR, topics.CAMERA_INFO, topics.DEPTH, topics.JOINT_STATES, *TRANSFORM_TOPICS)


@dataclass(frozen=True, eq=False)
class Observation:
    """Images of one moment, with the camera and the joints.

    stamp_ns: of the colour image [ns]; color: (H, W, 3) uint8 RGB; depth_m: (H, W) float32 [m], NaN where unknown;
    camera_in_base: pose of the optical frame in the base frame; joint_positions: [rad] or [m] by name.
    """

    stamp_ns: int
    color: npt.NDArray[np.uint8]
    depth_m: npt.NDArray[np.float32]
    camera: CameraModel
    camera_in_base: Pose
    joint_positions: dict[str, float]

    def heightmap(self, workspace: WorkspaceSpec) -> Heightmap:
        """Return the scene as seen from straight above."""
        return heightmap_from_rgbd(self.color, self.depth_m, self.camera, self.camera_in_base, workspace, self.stamp_ns)


def observation_from_messages(messages: Iterable[RawMessage], where: str, setup: CaptureSetup) -> Observation:
    """Return the observation in the messages of one step, by the latest of each topic; where: the step, for errors.

    The camera model is the setup's: camera_info alone does not say whether the images are rectified already. For
    images of another size it is camera_info's, as of raw images. Where the transforms do not connect camera and base,
    the setup's calibration is used. Depth is corrected as the setup says.

    Raises:
        ObservationError: when a topic is missing, or a message cannot be used.
    """
    latest: dict[str, Any] = {}
    joints: dict[str, float] = {}
    tree = TransformTree()
    try:
        for raw in messages:
            if raw.topic in TRANSFORM_TOPICS:
                put_transforms(tree, decode(raw))
            elif raw.topic == topics.JOINT_STATES:  # arm and hand may each send their own
                message = decode(raw)
                joints |= {name: float(p) for name, p in zip(message.name, message.position)}
            elif raw.topic in OBSERVATION_TOPICS:
                latest[raw.topic] = decode(raw)
        color, info, depth = (latest[topic] for topic in (topics.COLOR, topics.CAMERA_INFO, topics.DEPTH))
        for image in (color, depth):
            if (image.width, image.height) != (info.width, info.height):
                sizes = f"{image.width}x{image.height} pixels, where camera_info says {info.width}x{info.height}"
                raise ImageError(f"an image has {sizes}")
        return Observation(
            stamp_ns=stamp_of(color),
            color=np.array(decode_color(_buffer(color))),  # the decoded message's own pixels cannot be drawn on
            depth_m=setup.depth.apply(decode_depth(_buffer(depth))),
            camera=_camera(info, setup),
            camera_in_base=_camera_in_base(tree, info.header.frame_id, setup),
            joint_positions=joints,
        )
    except KeyError as error:
        raise ObservationError(f"{where} has no message on {error.args[0]}: record that topic too") from None
    except (CoreError, ValueError, AttributeError) as error:
        raise ObservationError(f"{where}: {error}") from None


def camera_from_info(info: Any) -> CameraModel:
    """Return the camera model of a CameraInfo message of raw images. Raises CameraModelError."""
    fx, _, cx, _, fy, cy = (float(v) for v in info.k[:6])
    return CameraModel(
        int(info.width),
        int(info.height),
        fx,
        fy,
        cx,
        cy,
        distortion_model=info.distortion_model,
        distortion=tuple(float(v) for v in info.d),
    )


def _camera(info: Any, setup: CaptureSetup) -> CameraModel:
    if (info.width, info.height) == (setup.camera.width, setup.camera.height):
        return setup.camera
    return camera_from_info(info)


def put_transforms(tree: TransformTree, message: Any) -> None:
    """Store the transforms of a TFMessage. Raises ValueError for a number that is not finite or a zero quaternion."""
    for each in message.transforms:
        t, q = each.transform.translation, each.transform.rotation
        pose = Pose.from_quaternion_xyzw((q.x, q.y, q.z, q.w), (t.x, t.y, t.z))
        tree.put(each.header.frame_id, each.child_frame_id, pose)


def _camera_in_base(tree: TransformTree, camera_frame: str, setup: CaptureSetup) -> Pose:
    try:
        return tree.source_in_target(camera_frame, setup.base_frame)
    except FrameError:
        return setup.camera_in_base


def _buffer(image: Any) -> ImageBuffer:
    return ImageBuffer(
        memoryview(image.data), image.height, image.width, image.step, image.encoding, bool(image.is_bigendian)
    )
