"""Conversion between a step's record and the messages that a bag holds."""

from __future__ import annotations

import math
from dataclasses import astuple
from typing import Any

from cliport_core import topics
from cliport_core.action import PickPlaceAction, Primitive
from cliport_core.outcome import ActionResult, Outcome
from cliport_core.pose import PlanarPose
from cliport_episodes.demonstration import PixelBox, Source, StepRecord
from cliport_episodes.errors import BagError, RecordError
from cliport_episodes.message_types import DEMONSTRATION, decode, encode, make, make_header, stamp_of
from cliport_episodes.raw import RawMessage

RECORD_TOPICS = (topics.INSTRUCTION, topics.PICK_POSE, topics.PLACE_POSE, topics.DEMONSTRATION)


def messages_from_record(record: StepRecord, stamp_ns: int) -> list[RawMessage]:
    """Return the messages of a step's record, received at `stamp_ns` [ns]; the Demonstration comes last."""
    header = make_header(record.stamp_ns, record.frame_id)
    action = record.action
    pick, place = _pose_message(action.pick), _pose_message(action.place)
    result = record.result or ActionResult(Outcome.SUCCEEDED, "")  # not read where `executed` is false
    centroid = result.grasp_centroid or (0.0, 0.0, 0.0)
    demonstration = make(
        DEMONSTRATION,
        header=header,
        step=record.step,
        instruction=record.instruction,
        primitive=int(action.primitive),
        source=int(record.source),
        pick_box=_region(record.pick_box),
        place_box=_region(record.place_box),
        pick_rotation=record.pick_rotation,
        place_rotation=record.place_rotation,
        n_rotations=record.n_rotations,
        pick=pick,
        place=place,
        executed=record.result is not None,
        outcome=int(result.outcome),
        message=result.message,
        grasp_centroid=make("geometry_msgs/msg/Point", x=centroid[0], y=centroid[1], z=centroid[2]),
        gripper_width=result.gripper_width,
    )
    return [
        encode(topics.INSTRUCTION, make("std_msgs/msg/String", data=record.instruction), stamp_ns),
        encode(topics.PICK_POSE, make("geometry_msgs/msg/PoseStamped", header=header, pose=pick), stamp_ns),
        encode(topics.PLACE_POSE, make("geometry_msgs/msg/PoseStamped", header=header, pose=place), stamp_ns),
        encode(topics.DEMONSTRATION, demonstration, stamp_ns),
    ]


def record_from_message(raw: RawMessage) -> StepRecord:
    """Return the record in a Demonstration.

    Raises:
        BagError: when the message is no Demonstration, or holds values that a demonstration cannot have.
    """
    message = decode(raw)
    try:
        action = PickPlaceAction(
            planar_from_message(message.pick), planar_from_message(message.place), Primitive(message.primitive)
        )
        return StepRecord(
            step=int(message.step),
            stamp_ns=stamp_of(message),
            frame_id=message.header.frame_id,
            instruction=message.instruction,
            source=Source(message.source),
            pick_box=_box(message.pick_box),
            place_box=_box(message.place_box),
            pick_rotation=int(message.pick_rotation),
            place_rotation=int(message.place_rotation),
            n_rotations=int(message.n_rotations),
            action=action,
            result=_result(message) if message.executed else None,
        )
    except (RecordError, AttributeError, TypeError, ValueError) as error:
        raise BagError(f"the demonstration on {raw.topic} is not usable: {error}") from None


def _result(message: Any) -> ActionResult:
    """Return the result in a Demonstration; a centroid at the origin stands for none."""
    point = message.grasp_centroid
    centroid = (float(point.x), float(point.y), float(point.z))
    outcome = Outcome.from_number(int(message.outcome))
    return ActionResult(outcome, message.message, centroid if any(centroid) else None, float(message.gripper_width))


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
    """Return the planar part of a Pose, without height, roll and pitch.

    Raises:
        ValueError: when the pose has no direction or is not finite.
    """
    p, q = message.position, message.orientation
    return PlanarPose.from_quaternion_xyzw((q.x, q.y, q.z, q.w), p.x, p.y)
