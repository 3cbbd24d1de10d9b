"""The gripper's pose among all transforms: only what moves the arm's chain is news of it."""

from __future__ import annotations

from cliport_core import Pose
from cliport_perception.calibration.gripper_feed import GripperFeed, Link

S = 1_000_000_000


def shift(x: float) -> Pose:
    return Pose.from_xyz_rpy((x, 0.0, 0.0), (0.0, 0.0, 0.0))


def feed() -> GripperFeed:
    """A feed that knows what is published once: the tool on the hand, the base in the room."""
    found = GripperFeed("base", "tool")
    found.put([Link("hand", "tool", shift(0.1), 0), Link("room", "base", shift(5.0), 0)])
    return found


def test_a_link_of_the_arm_brings_the_grippers_pose_with_its_own_stamp() -> None:
    arm = feed()
    news = arm.on_links([Link("/base", "hand", shift(0.4), 3 * S), Link("room", "person", shift(1.0), 9 * S)])
    assert news is not None
    stamp_ns, pose = news
    assert stamp_ns == 3 * S and pose.is_close(shift(0.5))


def test_other_links_are_no_news_of_the_arm() -> None:
    arm = feed()
    arm.on_links([Link("base", "hand", shift(0.4), 3 * S)])
    assert arm.on_links([Link("room", "person", shift(1.0), 4 * S)]) is None
    assert arm.on_links([Link("tool", "camera", shift(1.0), 4 * S)]) is None
    assert arm.on_links([Link("room", "base", shift(6.0), 4 * S)]) is None


def test_without_a_chain_or_a_stamp_there_is_no_pose() -> None:
    assert GripperFeed("base", "tool").on_links([Link("base", "hand", shift(0.4), S)]) is None
    assert feed().on_links([Link("base", "hand", shift(0.4), 0)]) is None
    circle = GripperFeed("base", "tool")
    assert circle.on_links([Link("a", "tool", shift(0.1), S), Link("tool", "a", shift(0.1), S)]) is None
