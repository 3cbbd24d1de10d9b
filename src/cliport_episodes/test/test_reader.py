"""Reading episodes back, whole and torn."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cliport_episodes.capture_setup import CaptureSetup
from cliport_episodes.checks import check_episode
from cliport_episodes.data_set import DataSet
from cliport_episodes.demonstration import StepRecord
from cliport_episodes.errors import BagError, EpisodeError, ObservationError
from cliport_episodes.message_types import decode
from cliport_episodes.raw import RawMessage
from cliport_episodes.reader import read_episode
from cliport_episodes.writer import EpisodeWriter

Scene = Callable[[int], list[RawMessage]]


@pytest.fixture
def path(data_set: DataSet, add_episode: Callable[..., str]) -> Path:
    return data_set.path / "episodes" / add_episode(data_set.path, n_steps=3)


def test_an_observation_is_what_the_camera_sent(path: Path, setup: CaptureSetup, scene: Scene) -> None:
    episode = read_episode(path)
    seen = episode.step(1).observation()
    sent = decode(scene(1)[1])
    np.testing.assert_array_equal(seen.color.reshape(-1), sent.data)
    assert seen.color.flags.writeable and seen.depth_m.flags.writeable
    assert seen.stamp_ns == sent.header.stamp.sec * 1_000_000_000
    assert seen.depth_m.dtype == np.float32 and seen.depth_m[0, 0] == pytest.approx(0.901)
    assert seen.camera_in_base.is_close(setup.camera_in_base, 1e-9)
    assert seen.joint_positions == {"panda_joint1": pytest.approx(0.1), "panda_finger_joint1": 0.04}
    assert seen.heightmap(setup.workspace).valid_fraction > 0.1
    assert episode.setup.differences(setup) == [] and check_episode(episode, setup) == []


def test_an_episode_can_be_read_alone_and_anywhere(path: Path, setup: CaptureSetup, tmp_path: Path) -> None:
    elsewhere = path.rename(tmp_path / "alone")
    episode = read_episode(elsewhere)
    assert len(episode.steps) == 3 and episode.setup.differences(setup) == []
    for file in elsewhere.iterdir():
        assert str(tmp_path).encode() not in file.read_bytes(), "a path of this machine is stored"


@pytest.mark.parametrize("left", [0.0, 0.01, 0.3, 0.6, 0.9])
def test_a_torn_step_costs_no_other(path: Path, left: float) -> None:
    file = path / "step_001.mcap"
    file.write_bytes(file.read_bytes()[: int(left * file.stat().st_size)])
    episode = read_episode(path)
    assert {0, 2} <= {step.record.step for step in episode.steps}
    assert any("step_001.mcap" in line for line in episode.complaints)
    for step in episode.steps:
        assert step.observation().color.shape == (48, 64, 3)


def test_a_step_torn_behind_its_messages_is_used(path: Path) -> None:
    file = path / "step_001.mcap"
    file.write_bytes(file.read_bytes()[:-200])
    episode = read_episode(path)
    assert len(episode.steps) == 3 and "are used" in episode.complaints[0]
    assert episode.steps[1].observation().joint_positions["panda_joint1"] == pytest.approx(0.1)


@pytest.mark.parametrize(
    "content", [None, "", "{", "a: b", "rosbag2_bagfile_information: {custom_data: {success: maybe}}"]
)
def test_without_its_metadata_only_the_edits_are_lost(path: Path, content: str | None) -> None:
    (path / "metadata.yaml").unlink()
    if content is not None:
        (path / "metadata.yaml").write_text(content)
    episode = read_episode(path)
    assert len(episode.steps) == 3 and episode.final is not None and episode.success is None
    assert len(episode.complaints) == 1 and "marks" in episode.complaints[0]
    EpisodeWriter.resume(path).close()
    assert read_episode(path).complaints == ()


def test_a_step_without_camera_info_says_so(data_set: DataSet, scene: Scene, record: StepRecord) -> None:
    writer = EpisodeWriter.create(data_set.path, data_set.setup)
    writer.add_step([message for message in scene(0) if "camera_info" not in message.topic], record)
    step = read_episode(writer.path).steps[0]
    with pytest.raises(ObservationError, match=r"step 0 .* no message on /camera/color/camera_info"):
        step.observation()
    found = check_episode(read_episode(writer.path), data_set.setup)
    assert any("camera_info" in line for line in found) and any("not finished" in line for line in found)


def test_transforms_that_were_lost_are_those_of_the_setup(data_set: DataSet, scene: Scene, record: StepRecord) -> None:
    writer = EpisodeWriter.create(data_set.path, data_set.setup)
    writer.add_step([message for message in scene(0) if message.topic != "/tf_static"], record)
    seen = read_episode(writer.path).steps[0].observation()
    assert seen.camera_in_base.is_close(data_set.setup.camera_in_base, 1e-9)


def test_garbled_pictures_are_one_error(data_set: DataSet, scene: Scene, record: StepRecord) -> None:
    messages = scene(0)
    image = messages[1].data
    smaller = image.replace((48).to_bytes(4, "little") + (64).to_bytes(4, "little"), b"\x10\0\0\0\x10\0\0\0", 1)
    assert smaller != image
    for garbled in (image[:50], image.replace(b"rgb8\0", b"weird"), smaller):
        writer = EpisodeWriter.create(data_set.path, data_set.setup)
        writer.add_step([messages[0], replace(messages[1], data=garbled), *messages[2:]], record)
        with pytest.raises(BagError):
            read_episode(writer.path).steps[0].observation()


def test_what_is_not_there_is_said(data_set: DataSet, path: Path) -> None:
    with pytest.raises(EpisodeError, match="no episode 'gone'"):
        read_episode(data_set.path / "episodes" / "gone")
    episode = read_episode(path)
    with pytest.raises(EpisodeError, match="no step 7: it has 0, 1, 2"):
        episode.step(7)


def test_an_episode_without_a_step_is_said(data_set: DataSet) -> None:
    writer = EpisodeWriter.create(data_set.path, data_set.setup)
    found = check_episode(read_episode(writer.path), data_set.setup)
    assert found[0] == "it has no step" and found[1].startswith("it was not finished")
