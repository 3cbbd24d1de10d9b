"""The ROS side of what people look at: poses, overlays and raw affordance maps."""

from __future__ import annotations

from typing import Any

import numpy as np
from geometry_msgs.msg import PoseStamped
from rclpy.node import Node
from sensor_msgs.msg import Image

from cliport_perception.conversions import image_to_msg, stamp_to_msg
from cliport_perception.heightmap import Heightmap
from cliport_policy import conversions
from cliport_policy.overlays import render_overlay
from cliport_policy.server.types import Proposal

KINDS = ("pick", "place")


class ProposalViews:
    """Publishes /cliport/{pick,place}_pose and /cliport/affordance/{pick,place}[/raw]."""

    def __init__(self, node: Node, base_frame: str) -> None:
        self._base_frame = base_frame
        self._poses, self._overlays, self._raws = {}, {}, {}
        for kind in KINDS:
            self._poses[kind] = node.create_publisher(PoseStamped, f"/cliport/{kind}_pose", 2)
            self._overlays[kind] = node.create_publisher(Image, f"/cliport/affordance/{kind}", 2)
            self._raws[kind] = node.create_publisher(Image, f"/cliport/affordance/{kind}/raw", 2)

    def publish_poses(self, proposal: Proposal) -> None:
        """Where the gripper would go; fast."""
        for kind, pose in (("pick", proposal.action.pick), ("place", proposal.action.place)):
            message = conversions.pose_stamped_to_msg(pose, self._base_frame, proposal.stamp_ns)
            self._poses[kind].publish(message)

    def publish_maps(self, heightmap: Heightmap, proposal: Proposal) -> None:
        """Overlays (rgb8, seen from behind the robot), raw maps (32FC1, rows x cols); takes some 50 ms."""
        action = proposal.action
        maps = {"pick": action.maps.pick, "place": action.maps.place} if action.maps else {}
        for kind in KINDS:
            picture = render_overlay(heightmap, maps.get(kind), action, kind)
            self._publish(self._overlays[kind], image_to_msg(picture, "rgb8"), proposal.stamp_ns)
            if kind in maps:
                raw = image_to_msg(np.asarray(maps[kind], np.float32), "32FC1")
                self._publish(self._raws[kind], raw, proposal.stamp_ns)

    def _publish(self, publisher: Any, image: Image, stamp_ns: int) -> None:
        image.header.frame_id = self._base_frame
        image.header.stamp = stamp_to_msg(stamp_ns)
        publisher.publish(image)
