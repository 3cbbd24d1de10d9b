"""Messages to the last value: of a camera, of times, poses and types."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from cliport_core.pose import PlanarPose
from cliport_episodes.bags import one_line
from cliport_episodes.data_set import DataSet
from cliport_episodes.demonstration_messages import _pose_message
from cliport_episodes.errors import BagError
from cliport_episodes.message_types import decode, make_header, stamp_of, types_of
from cliport_episodes.observation_messages import messages_from_observation
from cliport_episodes.raw import RawMessage


def test_messages_of_a_camera_to_the_last_value(data_set: DataSet, add_episode: Callable[..., str]) -> None:
    seen = data_set.episode(add_episode(data_set.path, 1)).steps[0].observation()
    seen.depth_m[0, :5] = (np.nan, 64.999, 65.0, 0.0004, 0.0006)
    color, depth, info, joints = (
        next(decode(raw) for raw in messages_from_observation(seen, "eye", "base") if raw.topic.endswith(topic))
        for topic in ("color/image_raw", "aligned_depth_to_color/image_raw", "camera_info", "joint_states")
    )
    assert (color.encoding, color.step, color.height, color.width, color.is_bigendian) == ("rgb8", 192, 48, 64, 0)
    assert (depth.encoding, depth.step, depth.height, depth.width, depth.is_bigendian) == ("16UC1", 128, 48, 64, 0)
    assert depth.data.view("<u2")[:5].tolist() == [0, 64999, 0, 0, 1]
    assert info.k.tolist() == [60, 0, 31.5, 0, 60, 23.5, 0, 0, 1] and info.r.tolist() == [1, 0, 0, 0, 1, 0, 0, 0, 1]
    assert info.p.tolist() == [60, 0, 31.5, 0, 0, 60, 23.5, 0, 0, 0, 1, 0] and info.d.tolist() == [0.0] * 5
    assert (color.header.frame_id, joints.header.frame_id, joints.velocity.tolist()) == ("eye", "", [])


def test_times_and_types_of_messages() -> None:
    header = make_header(12_000_000_034, "eye")
    assert (header.stamp.sec, header.stamp.nanosec, header.frame_id) == (12, 34, "eye")
    assert stamp_of(type("Message", (), {"header": header})) == 12_000_000_034
    pose = _pose_message(PlanarPose(0.1, 0.2, np.pi / 2))
    assert (pose.position.x, pose.position.y, pose.position.z) == (0.1, 0.2, 0.0)
    half = np.sqrt(0.5)
    turn = pose.orientation
    assert (turn.x, turn.y, turn.z, turn.w) == pytest.approx((0, 0, half, half))
    assert "std_msgs/msg/String" in types_of("std_msgs/msg/String", "no definition").types
    with pytest.raises(BagError, match="'x/msg/Y' is not known, and comes without a definition that can be read"):
        types_of("x/msg/Y", "")
    raw = RawMessage("/a", "std_msgs/msg/String", b"12", 3, "string data")
    assert raw == replace(raw, definition="") and raw != replace(raw, stamp_ns=4) and "12" not in repr(raw)
    assert one_line(ValueError(" two\n lines. ")) == "two lines" and one_line(KeyError()) == "KeyError"
