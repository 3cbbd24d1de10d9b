from __future__ import annotations

import numpy as np
import pytest

from cliport_core import FrameError, Pose
from cliport_core.transforms import TransformTree


def random_pose(seed: int) -> Pose:
    rng = np.random.default_rng(seed)
    return Pose.from_quaternion_xyzw(rng.normal(size=4), rng.normal(size=3))


def tree() -> tuple[TransformTree, list[Pose]]:
    poses = [random_pose(i) for i in range(4)]
    result = TransformTree()
    result.put("base", "mount", poses[0])
    result.put("mount", "camera_link", poses[1])
    result.put("/camera_link", "optical", poses[2])
    result.put("base", "hand", poses[3])
    return result, poses


def test_chains_are_followed_up_and_down() -> None:
    frames, poses = tree()
    assert frames.source_in_target("optical", "base").is_close(poses[0] @ poses[1] @ poses[2])
    assert frames.source_in_target("base", "optical").is_close((poses[0] @ poses[1] @ poses[2]).inverse())
    expected = poses[3].inverse() @ poses[0] @ poses[1] @ poses[2]
    assert frames.source_in_target("optical", "hand").is_close(expected)
    assert frames.source_in_target("/hand", "hand").is_close(Pose.identity())


def test_a_newer_transform_replaces_the_old() -> None:
    frames, poses = tree()
    frames.put("base", "hand", poses[0])
    assert frames.source_in_target("hand", "base").is_close(poses[0])


def test_a_frame_equals_itself_without_any_transform() -> None:
    assert TransformTree().source_in_target("base", "base").is_close(Pose.identity())


def test_missing_links_name_both_ends_and_what_is_known() -> None:
    frames, _ = tree()
    with pytest.raises(FrameError, match=r"from 'lidar' to 'base'.*known frames: base, camera_link"):
        frames.source_in_target("lidar", "base")
    with pytest.raises(FrameError, match="known frames: none"):
        TransformTree().source_in_target("a", "b")


def test_a_cycle_does_not_hang() -> None:
    frames = TransformTree()
    frames.put("a", "b", random_pose(0))
    frames.put("b", "a", random_pose(1))
    with pytest.raises(FrameError):
        frames.source_in_target("a", "c")
