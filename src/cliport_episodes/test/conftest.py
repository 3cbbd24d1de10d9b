"""A camera, an arm and a person, as far as a recorder sees them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cliport_core.action import PickPlaceAction
from cliport_core.outcome import ActionResult, Outcome
from cliport_core.pose import PlanarPose, Pose
from cliport_core.workspace import WorkspaceSpec
from cliport_episodes.capture_setup import CaptureSetup
from cliport_episodes.data_set import DataSet
from cliport_episodes.demonstration import PixelBox, Source, StepRecord
from cliport_episodes.observation import Observation
from cliport_episodes.observation_messages import messages_from_observation
from cliport_episodes.raw import RawMessage
from cliport_episodes.writer import EpisodeWriter
from cliport_perception.camera_model import CameraModel

SECOND = 1_000_000_000
BEGIN = 1_700_000_000 * SECOND


@pytest.fixture
def setup() -> CaptureSetup:
    return CaptureSetup(
        workspace=WorkspaceSpec(),
        camera=CameraModel(64, 48, 60.0, 60.0, 31.5, 23.5),
        camera_frame="camera_optical",
        base_frame="panda_link0",
        camera_in_base=Pose.looking_at((1.0, 0.0, 0.8), (0.45, 0.0, 0.0)),
    )


@pytest.fixture
def scene(setup: CaptureSetup) -> Callable[[int], list[RawMessage]]:
    """The messages of the n-th moment; the transforms were sent once, a minute before the first."""

    def messages(moment: int) -> list[RawMessage]:
        now, rng = BEGIN + 10 * moment * SECOND, np.random.default_rng(moment)
        seen = Observation(
            stamp_ns=now,
            color=rng.integers(0, 255, (48, 64, 3), dtype=np.uint8),
            depth_m=np.full((48, 64), 0.9 + 0.001 * moment, np.float32),
            camera=setup.camera,
            camera_in_base=setup.camera_in_base,
            joint_positions={"panda_joint1": 0.1 * moment, "panda_finger_joint1": 0.04},
        )
        _, joints, info, color, depth = messages_from_observation(seen, setup.camera_frame, setup.base_frame)
        early = replace(seen, stamp_ns=BEGIN - 60 * SECOND)
        transforms, *_ = messages_from_observation(early, setup.camera_frame, setup.base_frame)
        late = ((depth, 3), (color, 1), (info, 2), (joints, 0))
        return [*(replace(each, stamp_ns=now + by * 1_000_000) for each, by in late), transforms]

    return messages


@pytest.fixture
def record() -> StepRecord:
    return StepRecord(
        step=0,
        stamp_ns=BEGIN + 5,
        frame_id="panda_link0",
        instruction="put the red block in the green bowl",
        source=Source.CLICKED,
        pick_box=PixelBox(10, 20, 18, 30),
        place_box=None,
        pick_rotation=3,
        place_rotation=35,
        n_rotations=36,
        action=PickPlaceAction(PlanarPose(0.4, -0.1, 0.5), PlanarPose(0.5, 0.2, -3.0)),
        result=ActionResult(Outcome.GRASP_MISSED, "nothing between the fingers", (0.4, -0.1, 0.02), 0.031),
    )


@pytest.fixture
def data_set(tmp_path: Path, setup: CaptureSetup) -> DataSet:
    return DataSet.create(tmp_path / "blocks", setup)


@pytest.fixture
def add_episode(
    setup: CaptureSetup, scene: Callable[[int], list[RawMessage]], record: StepRecord
) -> Callable[..., str]:
    """Records an episode of some steps and returns its name."""

    def add(path: Path, n_steps: int = 2, name: str | None = None, success: bool | None = True, **changes: Any) -> str:
        writer = EpisodeWriter.create(path, setup, name)
        for step in range(n_steps):
            writer.add_step(scene(step), replace(record, **changes))
        writer.finish(scene(n_steps), success)
        return writer.name

    return add
