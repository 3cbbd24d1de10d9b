"""Records to messages and back."""

from dataclasses import replace
from pathlib import Path

import pytest
from rosbags.typesys import get_types_from_msg

from cliport_episodes.demonstration import PixelBox, StepRecord
from cliport_episodes.demonstration_messages import (
    DEMONSTRATION_TOPIC,
    RECORD_TOPICS,
    messages_from_record,
    record_from_message,
)
from cliport_episodes.errors import BagError, RecordError
from cliport_episodes.message_types import DEMONSTRATION, DEMONSTRATION_DEFINITION, decode
from cliport_episodes.raw import RawMessage
from cliport_perception.pose import PlanarPose

INTERFACES = Path(__file__).resolve().parents[2] / "cliport_interfaces"


def test_a_record_survives(record: StepRecord) -> None:
    for each in (record, replace(record, grasp_centroid=None, pick_box=None, executed=False, instruction="把它放下")):
        messages = messages_from_record(each, 7)
        assert [m.topic for m in messages] == list(RECORD_TOPICS) and {m.stamp_ns for m in messages} == {7}
        back = record_from_message(messages[-1])
        assert back.pick.yaw == pytest.approx(each.pick.yaw) and back.place.yaw == pytest.approx(each.place.yaw)
        assert replace(back, pick=each.pick, place=each.place) == each


def test_other_nodes_understand_the_messages(record: StepRecord) -> None:
    instruction, pick, place, _ = (decode(message) for message in messages_from_record(record, 7))
    assert instruction.data == record.instruction
    assert (pick.header.frame_id, pick.pose.position.x, place.pose.position.y) == ("panda_link0", 0.4, 0.2)


def test_the_definition_is_that_of_the_interfaces() -> None:
    text = (INTERFACES / "msg" / "Demonstration.msg").read_text()
    assert get_types_from_msg(text, DEMONSTRATION) == get_types_from_msg(DEMONSTRATION_DEFINITION, DEMONSTRATION)


def test_garbled_bytes_are_one_error(record: StepRecord) -> None:
    raw = messages_from_record(record, 7)[-1]
    for data in (b"", raw.data[:40], b"\0\1\0\0" + b"\xff" * 400):
        with pytest.raises(BagError, match=DEMONSTRATION_TOPIC):
            record_from_message(replace(raw, data=data))
    with pytest.raises(BagError, match="not known"):
        decode(RawMessage("/x", "their_msgs/msg/Thing", raw.data, 7))


def test_impossible_records_are_refused(record: StepRecord) -> None:
    for change in ({"pick_rotation": 36}, {"place_rotation": -1}, {"pick": PlanarPose(float("nan"), 0.0, 0.0)}):
        with pytest.raises(RecordError):
            replace(record, **change)  # type: ignore[arg-type]
    with pytest.raises(RecordError, match="holds no pixel"):
        PixelBox(5, 5, 5, 9)
