"""One camera's colour, depth and intrinsics as they come over ROS, matched by their stamps."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

from rclpy.node import Node
from sensor_msgs.msg import CameraInfo, CompressedImage, Image

from cliport_core import topics
from cliport_core.adaptive_subscription import AdaptiveSubscription
from cliport_core.errors import CoreError, ImageError
from cliport_core.raw_header import header_of_raw
from cliport_core.sync import ApproximateSync

SLOP_S = 0.02  # stamps that differ by no more are of one frame [s]
COMPRESSED_BELOW = {
    "color": "/compressed",
    "depth": "/compressedDepth",
    "camera_info": "",
}  # where image_transport has them
_INFOS = ("camera_info", "depth_info")
_TOPICS = {"color": topics.COLOR, "depth": topics.DEPTH, "camera_info": topics.CAMERA_INFO}


class RawReceived(NamedTuple):
    """A serialized message and when it came [ns, ROS time]."""

    data: bytes
    received_ns: int


class RawFrame(NamedTuple):
    """Serialized messages of one moment: two images, raw or compressed, and CameraInfo.

    stamp_ns is the depth image's, frame_id the colour's. Where depth is not aligned, depth_frame_id is its own frame
    and depth_info its own CameraInfo; else the first is frame_id.
    """

    color: RawReceived
    depth: RawReceived
    camera_info: RawReceived
    stamp_ns: int
    frame_id: str
    depth_frame_id: str = ""
    depth_info: RawReceived | None = None


class RgbdInput:
    """Subscribes to a camera and hands on frames, undecoded, so that a frame which nobody wants costs little."""

    def __init__(
        self,
        node: Node,
        on_frame: Callable[[RawFrame], None],
        on_fault: Callable[[str], None],
        on_message: Callable[[str], None] = lambda stream: None,
        slop_s: float = SLOP_S,
        compressed: bool = False,
        number: int = 1,
        depth_info: str = "",
    ) -> None:
        """Subscribe to the camera's topics; compressed: to those that image_transport puts below them.

        number: of the camera, from 1. depth_info: the depth camera's CameraInfo topic, which allows depth in a frame of
        its own; empty: depth must be aligned with colour.
        on_fault: told why a match cannot be used, in one line; CoreError raised by on_frame ends there too.
        on_message: called with the stream's name, color, depth or camera_info, at every message.
        """
        self._on_frame, self._on_fault, self._on_message = on_frame, on_fault, on_message
        self._now_ns = lambda: int(node.get_clock().now().nanoseconds)
        self._sync: ApproximateSync[RawReceived] = ApproximateSync(("color", "depth"), int(slop_s * 1e9))
        self._infos: dict[str, RawReceived] = {}
        names = {stream: topics.of_camera(topic, number) for stream, topic in _TOPICS.items()}
        if depth_info:
            names["depth_info"] = depth_info
        self.subscriptions = {}
        for stream, name in names.items():
            kind, take = (CompressedImage if compressed else Image), partial(self._take_image, stream)
            if stream in _INFOS:
                kind, take = CameraInfo, partial(self._take_info, stream)
            elif compressed:
                name += COMPRESSED_BELOW[stream]
            self.subscriptions[stream] = AdaptiveSubscription(node, kind, name, take, raw=True)

    @property
    def topic_names(self) -> dict[str, str]:
        """The topic of each stream after remapping."""
        return {stream: subscription.topic_name for stream, subscription in self.subscriptions.items()}

    def adapt(self) -> None:
        """Become reliable or best effort as the camera's publishers are; call now and then."""
        for subscription in self.subscriptions.values():
            subscription.adapt()

    def take_counts(self) -> tuple[int, int]:
        """Return the numbers of matches made and of images dropped since the last call."""
        return self._sync.take_counts()

    def _take_info(self, stream: str, raw: bytes) -> None:
        self._on_message(stream)
        self._infos[stream] = RawReceived(raw, self._now_ns())

    def _take_image(self, stream: str, raw: bytes) -> None:
        self._on_message(stream)
        try:
            match = self._sync.add(stream, header_of_raw(raw)[0], RawReceived(raw, self._now_ns()))
            if match is not None:
                self._on_frame(self._frame(match["color"], match["depth"]))
        except CoreError as error:
            self._on_fault(str(error))

    def _frame(self, color: RawReceived, depth: RawReceived) -> RawFrame:
        info = self._info("camera_info")
        stamp_ns, depth_frame = header_of_raw(depth.data)
        frame = header_of_raw(color.data)[1]
        if frame == depth_frame:
            return RawFrame(color, depth, info, stamp_ns, frame, frame)
        if "depth_info" not in self.subscriptions:
            raise ImageError(
                f"depth is in frame '{depth_frame}', colour in '{frame}': use aligned depth; perception can also align "
                "it itself, with its parameter depth_camera_info"
            )
        return RawFrame(color, depth, info, stamp_ns, frame, depth_frame, self._info("depth_info"))

    def _info(self, stream: str) -> RawReceived:
        if stream not in self._infos:
            raise ImageError(f"images come, but nothing on {self.subscriptions[stream].topic_name}")
        return self._infos[stream]
