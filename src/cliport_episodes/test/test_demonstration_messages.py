"""Records to messages and back."""

from dataclasses import replace
from pathlib import Path

import pytest
from rosbags.typesys import get_types_from_msg

from cliport_core import topics
from cliport_core.action import PickPlaceAction, Primitive
from cliport_core.outcome import ActionResult, Outcome
from cliport_core.pose import PlanarPose
from cliport_episodes.demonstration import PixelBox, StepRecord
from cliport_episodes.demonstration_messages import (
    RECORD_TOPICS,
    messages_from_record,
    record_from_message,
)
from cliport_episodes.errors import BagError, RecordError
from cliport_episodes.message_types import DEMONSTRATION, DEMONSTRATION_DEFINITION, decode, encode
from cliport_episodes.raw import RawMessage

INTERFACES = Path(__file__).resolve().parents[2] / "cliport_interfaces"


@pytest.mark.parametrize("primitive", list(Primitive))
def test_a_record_survives(record: StepRecord, primitive: Primitive) -> None:
    assert record.result is not None
    without_grasp = replace(record.result, grasp_centroid=None)
    for each in (
        replace(record, action=replace(record.action, primitive=primitive)),
        replace(record, result=without_grasp, pick_box=None, instruction="把它放下"),
        replace(record, result=None),
    ):
        messages = messages_from_record(each, 7)
        assert [m.topic for m in messages] == list(RECORD_TOPICS) and {m.stamp_ns for m in messages} == {7}
        back = record_from_message(messages[-1])
        mine, theirs = back.action, each.action
        assert (mine.pick.yaw, mine.place.yaw) == pytest.approx((theirs.pick.yaw, theirs.place.yaw))
        assert replace(back, action=replace(mine, pick=theirs.pick, place=theirs.place)) == each


def test_an_outcome_of_a_later_version_is_a_failed_execution(record: StepRecord) -> None:
    assert record.result is not None
    raw = messages_from_record(replace(record, result=replace(record.result, message="")), 7)[-1]
    message = decode(raw)
    message.outcome = 99
    back = record_from_message(encode(raw.topic, message, 7))
    assert back.result is not None and back.result.outcome is Outcome.EXECUTION_FAILED
    assert back.ending == "execution failed"


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
        with pytest.raises(BagError, match=topics.DEMONSTRATION):
            record_from_message(replace(raw, data=data))
    with pytest.raises(BagError, match="not known"):
        decode(RawMessage("/x", "their_msgs/msg/Thing", raw.data, 7))


def test_impossible_records_are_refused(record: StepRecord) -> None:
    nowhere = PickPlaceAction(PlanarPose(float("nan"), 0.0, 0.0), record.action.place)
    unmeasured = ActionResult(Outcome.SUCCEEDED, "", None, float("nan"))
    changes = ({"pick_rotation": 36}, {"place_rotation": -1}, {"action": nowhere}, {"result": unmeasured})
    for change in changes:
        with pytest.raises(RecordError):
            replace(record, **change)  # type: ignore[arg-type]
    with pytest.raises(RecordError, match="holds no pixel"):
        PixelBox(5, 5, 5, 9)
