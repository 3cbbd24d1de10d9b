"""Previews of plans on topics, latched: the joints' trajectory, markers for RViz, and a picture from above."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from geometry_msgs.msg import Point, Vector3
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import Image
from std_msgs.msg import ColorRGBA
from trajectory_msgs.msg import JointTrajectory as JointTrajectoryMsg
from visualization_msgs.msg import Marker, MarkerArray

from cliport_core import topics
from cliport_core.messages import image_to_msg, pose_to_msg, stamp_to_msg
from cliport_core.pose import Pose as RigidPose
from panda_executor import conversions
from panda_executor.model import PandaModel
from panda_executor.motions import Motion
from panda_executor.phase import Phase
from panda_executor.plan_preview import PreviewPath, joined, paths, picture
from panda_model.limits import FloatArray

_COLORS = {  # by what the motion does; the rest is the way there and back
    Phase.CARRY: (1.0, 0.6, 0.1),
    Phase.DESCEND: (0.2, 0.8, 1.0),
    Phase.LOWER: (0.2, 0.8, 1.0),
}
_LINE, _SWEPT, _GRASP = 0.004, 0.12, 0.8  # width [m] of a way; opacities of the swept hands and of those that grasp


class PlanPreviews:
    """Publishes what a plan will do, under its id."""

    def __init__(self, node: Node, model: PandaModel, base_frame: str) -> None:
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self._model, self._base_frame, self._clock = model, base_frame, node.get_clock()
        self._trajectory = node.create_publisher(JointTrajectoryMsg, topics.PREVIEW_TRAJECTORY, latched)
        self._markers = node.create_publisher(MarkerArray, topics.PREVIEW_MARKERS, latched)
        self._picture = node.create_publisher(Image, topics.PREVIEW_PICTURE, latched)

    def show(self, plan_id: str, motions: Sequence[Motion]) -> None:
        """Publish a plan's motions, in place of any other's; to be called in the thread that planned them."""
        stamp = stamp_to_msg(self._clock.now().nanoseconds)
        whole = joined(motions)
        trajectory = conversions.trajectory_to_msg(whole, whole.joint_names)
        trajectory.header.frame_id, trajectory.header.stamp = f"plan {plan_id}", stamp
        ways = paths(self._model, motions)
        markers = preview_markers(plan_id, ways, self._base_frame)
        image = image_to_msg(picture(motions[0].scene.grid, ways), "rgb8")
        image.header.frame_id, image.header.stamp = f"plan {plan_id}", stamp
        for marker in markers.markers:
            marker.header.stamp = stamp
        self._trajectory.publish(trajectory)
        self._markers.publish(markers)
        self._picture.publish(image)


def preview_markers(plan_id: str, ways: Sequence[PreviewPath], base_frame: str) -> MarkerArray:
    """Return a plan's markers: its id, each motion's way, and boxes around the hand along it and where it acts."""
    clear = Marker(action=Marker.DELETEALL)
    clear.header.frame_id = base_frame
    markers = [clear]
    for number, way in enumerate(ways):
        color = _COLORS.get(way.phase, (0.6, 0.6, 0.6))
        line = Marker(ns="path", id=number, type=Marker.LINE_STRIP, scale=Vector3(x=_LINE), color=_color(color, 1.0))
        line.points = [_point(position) for position in way.positions]
        markers.append(line)
        for index in way.hands():
            markers.append(_hand("swept", len(markers), way, int(index), _color(color, _SWEPT)))
        if way.phase in (Phase.DESCEND, Phase.LOWER):
            markers.append(_hand("grasp", len(markers), way, len(way.positions) - 1, _color(color, _GRASP)))
    label = Marker(ns="plan", type=Marker.TEXT_VIEW_FACING, text=f"plan {plan_id}", scale=Vector3(z=0.03))
    label.color = _color((1.0, 1.0, 1.0), 1.0)
    label.pose.position = _point(ways[0].positions[-1] + np.array([0.0, 0.0, 0.15]))
    markers.append(label)
    for marker in markers:
        marker.header.frame_id = base_frame
    return MarkerArray(markers=markers)


def _hand(namespace: str, number: int, way: PreviewPath, index: int, color: ColorRGBA) -> Marker:
    """Return the box around the hand, and what it holds, at one of a way's poses."""
    lower, upper = way.hand.points.min(axis=0), way.hand.points.max(axis=0)
    rotation = way.rotations[index]
    pose = pose_to_msg(RigidPose(rotation, way.positions[index] + rotation @ ((lower + upper) / 2.0)))
    size = _point(upper - lower)
    return Marker(
        ns=namespace, id=number, type=Marker.CUBE, pose=pose, scale=Vector3(x=size.x, y=size.y, z=size.z), color=color
    )


def _point(position: FloatArray) -> Point:
    return Point(x=float(position[0]), y=float(position[1]), z=float(position[2]))


def _color(rgb: tuple[float, float, float], alpha: float) -> ColorRGBA:
    return ColorRGBA(r=rgb[0], g=rgb[1], b=rgb[2], a=alpha)
