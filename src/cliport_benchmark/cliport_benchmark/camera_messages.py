"""Messages of the simulated camera and arm, as a bag holds them, made without ROS."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from cliport_core import Pose, topics
from cliport_episodes.observation import Observation
from cliport_episodes.observation_messages import messages_from_observation
from cliport_episodes.raw import RawMessage
from cliport_perception import CameraModel
from sim_bridge.panda import ArmState
from sim_bridge.rendering.camera import OPTICAL_FRAME, RgbdFrame
from sim_bridge.robot import ROBOT

BASE_FRAME = ROBOT.base_frame
_LATENCY_NS = 40_000_000


def observation_messages(
    frame: RgbdFrame, camera: CameraModel, camera_in_base: Pose, state: ArmState, stamp_ns: int
) -> list[RawMessage]:
    """Return all messages that an observation is made of, with one stamp [ns].

    The images are received a little later than the rest, so that a replay has that when they come.
    """
    positions = np.concatenate([state.positions, state.finger_positions]).tolist()
    joints = dict(zip(ROBOT.joints, positions, strict=True))
    messages = messages_from_observation(
        Observation(stamp_ns, frame.color, frame.depth, camera, camera_in_base, joints),
        OPTICAL_FRAME,
        BASE_FRAME,
        velocities=[*state.velocities, *state.finger_velocities],
        efforts=[*state.efforts, 0.0, 0.0],
    )
    images, later = (topics.COLOR, topics.DEPTH), stamp_ns + _LATENCY_NS
    return [replace(raw, stamp_ns=later) if raw.topic in images else raw for raw in messages]
