"""Views of a proposal for people, over ROS: poses, overlays and raw affordance maps."""

from __future__ import annotations

from typing import Any

import numpy as np
from geometry_msgs.msg import PoseStamped
from rclpy.node import Node
from sensor_msgs.msg import Image

from cliport_core import topics
from cliport_core.action import ActionGoal
from cliport_core.heightmap import Heightmap
from cliport_core.messages import image_to_msg, pose_stamped_to_msg, stamp_to_msg
from cliport_policy.inference import Inference
from cliport_policy.overlays import render_overlay


class ProposalViews:
    """Publishes /cliport/{pick,place}_pose and /cliport/affordance/{pick,place}[/raw]."""

    def __init__(self, node: Node, base_frame: str) -> None:
        self._base_frame = base_frame
        self._poses, self._overlays, self._raws = {}, {}, {}
        for kind in topics.KINDS:
            self._poses[kind] = node.create_publisher(PoseStamped, topics.POSES[kind], 2)
            self._overlays[kind] = node.create_publisher(Image, topics.AFFORDANCES[kind], 2)
            self._raws[kind] = node.create_publisher(Image, topics.RAW_AFFORDANCES[kind], 2)

    def publish_poses(self, goal: ActionGoal) -> None:
        """Publish where the gripper would go; fast."""
        for kind, pose in (("pick", goal.action.pick), ("place", goal.action.place)):
            self._poses[kind].publish(pose_stamped_to_msg(pose, self._base_frame, goal.stamp_ns))

    def publish_maps(self, heightmap: Heightmap, inference: Inference) -> None:
        """Publish overlays (rgb8, seen from behind the robot) and raw maps (32FC1, rows x cols); takes some 50 ms."""
        maps = {"pick": inference.maps.pick, "place": inference.maps.place} if inference.maps else {}
        for kind in topics.KINDS:
            picture = render_overlay(heightmap, maps.get(kind), inference, kind)
            self._publish(self._overlays[kind], image_to_msg(picture, "rgb8"), heightmap.stamp_ns)
            if kind in maps:
                raw = image_to_msg(np.asarray(maps[kind], np.float32), "32FC1")
                self._publish(self._raws[kind], raw, heightmap.stamp_ns)

    def _publish(self, publisher: Any, image: Image, stamp_ns: int) -> None:
        image.header.frame_id = self._base_frame
        image.header.stamp = stamp_to_msg(stamp_ns)
        publisher.publish(image)
