"""A step's record as the messages that a bag holds, and back."""

from __future__ import annotations

import math
from dataclasses import astuple
from typing import Any

from cliport_episodes.demonstration import PixelBox, Source, StepRecord
from cliport_episodes.errors import BagError, RecordError
from cliport_episodes.message_types import DEMONSTRATION, decode, encode, make, make_header, stamp_of
from cliport_episodes.raw import RawMessage
from cliport_perception.pose import PlanarPose, Pose
from cliport_perception.primitive import Primitive

INSTRUCTION_TOPIC = "/cliport/instruction"
PICK_TOPIC = "/cliport/pick_pose"
PLACE_TOPIC = "/cliport/place_pose"
DEMONSTRATION_TOPIC = "/cliport/demonstration"
RECORD_TOPICS = (INSTRUCTION_TOPIC, PICK_TOPIC, PLACE_TOPIC, DEMONSTRATION_TOPIC)


def messages_from_record(record: StepRecord, stamp_ns: int) -> list[RawMessage]:
    """The messages that say what was done, as received at `stamp_ns`; the Demonstration comes last."""
    header = make_header(record.stamp_ns, record.frame_id)
    pick, place = _pose_message(record.pick), _pose_message(record.place)
    centroid = record.grasp_centroid or (0.0, 0.0, 0.0)
    demonstration = make(
        DEMONSTRATION,
        header=header,
        step=record.step,
        instruction=record.instruction,
        primitive=int(record.primitive),
        source=int(record.source),
        pick_box=_region(record.pick_box),
        place_box=_region(record.place_box),
        pick_rotation=record.pick_rotation,
        place_rotation=record.place_rotation,
        n_rotations=record.n_rotations,
        pick=pick,
        place=place,
        executed=record.executed,
        outcome=record.outcome,
        message=record.message,
        grasp_centroid=make("geometry_msgs/msg/Point", x=centroid[0], y=centroid[1], z=centroid[2]),
        gripper_width=record.gripper_width,
    )
    return [
        encode(INSTRUCTION_TOPIC, make("std_msgs/msg/String", data=record.instruction), stamp_ns),
        encode(PICK_TOPIC, make("geometry_msgs/msg/PoseStamped", header=header, pose=pick), stamp_ns),
        encode(PLACE_TOPIC, make("geometry_msgs/msg/PoseStamped", header=header, pose=place), stamp_ns),
        encode(DEMONSTRATION_TOPIC, demonstration, stamp_ns),
    ]


def record_from_message(raw: RawMessage) -> StepRecord:
    """The record in a Demonstration.

    Raises:
        BagError: when the message is none, or holds values that a demonstration cannot have.
    """
    message = decode(raw)
    try:
        centroid = message.grasp_centroid
        return StepRecord(
            step=int(message.step),
            stamp_ns=stamp_of(message),
            frame_id=message.header.frame_id,
            instruction=message.instruction,
            primitive=Primitive(message.primitive),
            source=Source(message.source),
            pick_box=_box(message.pick_box),
            place_box=_box(message.place_box),
            pick_rotation=int(message.pick_rotation),
            place_rotation=int(message.place_rotation),
            n_rotations=int(message.n_rotations),
            pick=planar_from_message(message.pick),
            place=planar_from_message(message.place),
            executed=bool(message.executed),
            outcome=int(message.outcome),
            message=message.message,
            grasp_centroid=(centroid.x, centroid.y, centroid.z) if any((centroid.x, centroid.y, centroid.z)) else None,
            gripper_width=message.gripper_width,
        )
    except (RecordError, AttributeError, TypeError, ValueError) as error:
        raise BagError(f"the demonstration on {raw.topic} is not usable: {error}") from None


def _region(box: PixelBox | None) -> Any:
    top, left, bottom, right = astuple(box) if box else (0, 0, 0, 0)
    return make(
        "sensor_msgs/msg/RegionOfInterest",
        x_offset=left,
        y_offset=top,
        height=bottom - top,
        width=right - left,
        do_rectify=False,
    )


def _box(region: Any) -> PixelBox | None:
    if not region.height and not region.width:
        return None
    top, left = int(region.y_offset), int(region.x_offset)
    return PixelBox(top, left, top + int(region.height), left + int(region.width))


def _pose_message(pose: PlanarPose) -> Any:
    z, w = math.sin(pose.yaw / 2.0), math.cos(pose.yaw / 2.0)
    return make(
        "geometry_msgs/msg/Pose",
        position=make("geometry_msgs/msg/Point", x=pose.x, y=pose.y, z=0.0),
        orientation=make("geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=z, w=w),
    )


def planar_from_message(message: Any) -> PlanarPose:
    """Of a Pose; height, roll and pitch are dropped. Raises ValueError when it has no direction or is not finite."""
    p, q = message.position, message.orientation
    return PlanarPose.from_pose(Pose.from_quaternion_xyzw((q.x, q.y, q.z, q.w), (p.x, p.y, p.z)))
