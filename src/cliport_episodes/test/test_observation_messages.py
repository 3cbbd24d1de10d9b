"""An observation as messages, and back."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from cliport_core.pose import Pose
from cliport_episodes.capture_setup import CaptureSetup
from cliport_episodes.message_types import decode, stamp_of
from cliport_episodes.observation import Observation, observation_from_messages
from cliport_episodes.observation_messages import messages_from_observation

STAMP = 12_000_000_034


@pytest.fixture
def seen(setup: CaptureSetup) -> Observation:
    rng = np.random.default_rng(0)
    depth = rng.uniform(0.3, 1.5, (48, 64)).astype(np.float32)
    depth[:2] = [[np.nan], [70.0]]  # unknown, and too far for the encoding
    return Observation(
        stamp_ns=STAMP,
        color=rng.integers(0, 256, (48, 64, 3), dtype=np.uint8),
        depth_m=depth,
        camera=replace(setup.camera, distortion=(0.1, -0.2, 0.001, 0.002, 0.05)),
        camera_in_base=Pose.looking_at((0.9, 0.2, 0.7), (0.5, 0.1, 0.0)),
        joint_positions={"panda_joint1": 0.3, "panda_finger_joint1": 0.04},
    )


def test_an_observation_comes_back(seen: Observation, setup: CaptureSetup) -> None:
    messages = messages_from_observation(seen, setup.camera_frame, setup.base_frame)
    back = observation_from_messages(messages, "here", replace(setup, camera=seen.camera))
    assert (back.stamp_ns, back.camera, back.joint_positions) == (STAMP, seen.camera, seen.joint_positions)
    np.testing.assert_array_equal(back.color, seen.color)
    assert np.isnan(back.depth_m[:2]).all()
    np.testing.assert_allclose(back.depth_m[2:], seen.depth_m[2:], rtol=0.0, atol=0.00051)
    assert back.camera_in_base.is_close(seen.camera_in_base), "the transform's, not the setup's"


def test_every_message_says_when_it_was_sent_and_received(seen: Observation) -> None:
    joints = {"velocities": [0.5, 0.0], "efforts": [3.0, 0.0]}
    sent = messages_from_observation(seen, "camera", "panda_link0", received_ns=STAMP + 5, **joints)
    messages = {raw.topic: raw for raw in sent}
    assert {raw.stamp_ns for raw in messages.values()} == {STAMP + 5}
    decoded = {topic: decode(raw) for topic, raw in messages.items()}
    (link,) = decoded.pop("/tf_static").transforms
    assert {stamp_of(message) for message in (link, *decoded.values())} == {STAMP}
    assert (link.header.frame_id, link.child_frame_id) == ("panda_link0", "camera")
    state = decoded["/joint_states"]
    assert (list(state.velocity), list(state.effort)) == ([0.5, 0.0], [3.0, 0.0])


def test_the_camera_of_rectified_images_is_the_setups(seen: Observation, setup: CaptureSetup) -> None:
    """The K and D of camera_info are those of raw images."""
    messages = messages_from_observation(seen, setup.camera_frame, setup.base_frame)
    assert observation_from_messages(messages, "here", setup).camera == setup.camera
    smaller = replace(setup, camera=replace(setup.camera, width=32, height=24))
    assert observation_from_messages(messages, "here", smaller).camera == seen.camera


def test_the_camera_info_is_of_the_whole_image(seen: Observation) -> None:
    (raw,) = (raw for raw in messages_from_observation(seen, "camera", "base") if raw.topic.endswith("camera_info"))
    info = decode(raw)
    roi = info.roi
    assert (roi.x_offset, roi.y_offset, roi.height, roi.width, roi.do_rectify) == (0, 0, 0, 0, False)
    assert (info.binning_x, info.binning_y, info.height, info.width) == (0, 0, 48, 64)
